#!/usr/bin/env bash
# Finding pyquaternion-global-rates: pyquaternion 0.9.9
#
# Does: integrate and derivative take the angular velocity about the axes of the body, where their documentation says
#   the global axes: a body that is turned by 0.9 rad about x and then turns at 2 rad/s about the global z axis is off
#   by 0.17 rad after 0.1 s.
# Right: the rotation by 0.2 rad about the global z axis after the start's; for global rates q' = 1/2 ω q.
# Cause: The code multiplies q by ω from the right, which is right for rates in the body's axes. Related: issue 53 of
#   KieranWynn/pyquaternion (open), on what the axes are.
#
# Stated: 0.17375 rad off after a turn of 0.2 rad
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q pyquaternion==0.9.9 numpy

cat > "$place/proof.py" <<'END'
import math

from pyquaternion import Quaternion

ANGLE, RATE, SECONDS = 0.9, 2.0, 0.1  # rad of the start about x, rad/s about the global z axis, s
start = Quaternion(axis=[1, 0, 0], angle=ANGLE)
turn = Quaternion(axis=[0, 0, 1], angle=RATE * SECONDS)


def apart(first, second):
    """Return the angle (rad) between two orientations."""
    between = first.inverse * second
    return 2 * math.atan2(math.hypot(*between.vector), abs(between.scalar))


found = Quaternion(start)
found.integrate([0.0, 0.0, RATE], SECONDS)
assert apart(found, start * turn) < 1e-9  # the rotation about the body's axis
print(apart(found, turn * start))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pyquaternion 0.9.9: stated 0.17375, seen $seen rad off after a turn of 0.2 rad"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.17375) <= 0.017375)' "$seen" || {
    echo "This has changed."
    exit 1
}
