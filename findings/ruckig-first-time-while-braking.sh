#!/usr/bin/env bash
# Finding ruckig-first-time-while-braking: ruckig 0.19.4
#
# Does: Trajectory.get_first_time_at_position leaves out the phase in which a motion above its limit of velocity
#   brakes: a position that is passed at 0.1 s is said to be reached first at 3.22 s, on the way back.
# Right: 0.1 s, where at_time has this position: 5 t - 10 t³/6 = 0.49833 m.
# Cause: The braking phases are no part of the list of phases that is searched, nor of the search for extrema.
#
# Stated: 3.1217 s too late
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

given = InputParameter(1)
given.current_position, given.current_velocity, given.target_position = [0.0], [5.0], [0.0]
given.max_velocity, given.max_acceleration, given.max_jerk = [2.0], [3.0], [10.0]
made = Trajectory(1)
assert Ruckig(1).calculate(given, made) is Result.Working
early, place = 0.1, 5.0 * 0.1 - 10.0 * 0.1**3 / 6  # s, m: the jerk is -10 m/s³ during the first 0.3 s
assert abs(made.at_time(early)[0][0] - place) < 1e-9
print(made.get_first_time_at_position(0, place) - early)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "ruckig 0.19.4: stated 3.1217, seen $seen s too late"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 3.1217) <= 0.31217)' "$seen" || {
    echo "This has changed."
    exit 1
}
