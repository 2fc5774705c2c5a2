#!/usr/bin/env bash
# Finding spatialmath-log-near-half-turn: spatialmath-python 1.1.18
#
# Does: trlog, by which SO3.log, SE3.log and twists are made, is off by up to 0.03 rad for a rotation that lacks 7e-8
#   rad to half a turn, and by up to 2e-4 rad near 1e-6; at half a turn it is right.
# Right: the angle π - 7e-8, from sine and cosine of the matrix by atan2.
# Cause: The angle is acos((trace - 1)/2), whose rounding is 1e-16 of a difference of 2e-15 there, and the axis is
#   divided by the sine of this angle. MatrixLog3 of modern_robotics 1.1.1 has the same error.
#
# Stated: 0.0307 rad off
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q spatialmath-python==1.1.18 numpy

cat > "$place/proof.py" <<'END'
import math

import numpy as np
from spatialmath import base


def error(lack):
    """Return the error of the logarithm (rad) of a rotation about z that lacks an angle to half a turn."""
    cosine, sine = -math.cos(lack), math.sin(lack)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return abs(np.linalg.norm(base.trlog(turn, twist=True)) - (math.pi - lack))


assert error(0.0) < 1e-12 and error(1e-3) < 1e-9
print(max(error(lack) for lack in np.linspace(7e-8, 3e-7, 400)))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "spatialmath-python 1.1.18: stated 0.0307, seen $seen rad off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.0307) <= 0.00307)' "$seen" || {
    echo "This has changed."
    exit 1
}
