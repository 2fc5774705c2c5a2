#!/usr/bin/env bash
# Finding ruckig-position-extrema: ruckig 0.19.4
#
# Does: Trajectory.position_extrema misses extrema in a phase of constant acceleration: a motion that starts at 1 m/s
#   away from its target goes 0.3054 m that way, and the largest position is said to be 0.2550 m.
# Right: 0.3054 m = 0.255 m while the jerk of -10 m/s³ acts, and v²/(2 a) = 0.0504 m at -3 m/s² from 0.55 m/s; at_time
#   has it.
# Cause: The zero of the velocity is sought in phases with a jerk; in others only the ends of the phase count. A
#   collision test by these extrema does not see the overshoot. Known as issue 215 of pantor/ruckig (open).
#
# Stated: 0.050416 m of 0.305 left out
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q ruckig==0.19.4 numpy

cat > "$place/proof.py" <<'END'
from ruckig import InputParameter, Result, Ruckig, Trajectory

SPEED, ACCELERATION, JERK = 1.0, 3.0, 10.0  # m/s away from the target at the start; limits in m/s², m/s³
given = InputParameter(1)
given.current_position, given.current_velocity, given.target_position = [0.0], [SPEED], [-10.0]
given.max_velocity, given.max_acceleration, given.max_jerk = [2.0], [ACCELERATION], [JERK]
made = Trajectory(1)
assert Ruckig(1).calculate(given, made) is Result.Working
ramp = ACCELERATION / JERK  # s until the acceleration is at its limit
left = SPEED - JERK * ramp**2 / 2  # m/s
right = SPEED * ramp - JERK * ramp**3 / 6 + left**2 / (2 * ACCELERATION)
assert abs(made.at_time(ramp + left / ACCELERATION)[0][0] - right) < 1e-9
print(right - made.position_extrema[0].max)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "ruckig 0.19.4: stated 0.050416, seen $seen m of 0.305 left out"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.050416) <= 0.0050416)' "$seen" || {
    echo "This has changed."
    exit 1
}
