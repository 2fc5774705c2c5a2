#!/usr/bin/env bash
# Finding exudyn-tree66-external-torque: exudyn 1.13.6
#
# Does: ComputeMassMatrixAndForceTerms of KinematicTree66 applies external torques and forces wrongly from the second
#   link on: a torque of 1 N m across the first axis, on a link behind two hinges about z and x, acts on the first
#   hinge, and not on the second.
# Right: the shares of the torque along the axes, 0 about z and sin(0.5) = 0.479 N m about the second axis at an angle
#   of 0.5 rad. A torque along z gives the right terms.
# Cause: AddExternalForces multiplies transformations by * (Xup[i] * Xa[parent]), which is elementwise for arrays; a
#   product of matrices needs @.
#
# Stated: 0.4818 N m of 1 off
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q exudyn==1.13.6 numpy

cat > "$place/proof.py" <<'END'
import numpy as np
from exudyn.kinematicTree import KinematicTree66, MassCOMinertia2T66

ANGLE, UNIT = 0.5, np.eye(6)  # rad
link = MassCOMinertia2T66(1.0, [0.0, 0.0, 0.0], np.eye(3))
tree = KinematicTree66(["Rz", "Rx"], [UNIT, UNIT], [link, link], gravity=[0.0, 0.0, 0.0])


def force_terms(direction):
    """Return the joints' force terms at rest for a torque of 1 N m on the second link, in the world's axes."""
    torques = [np.zeros(6), np.array([*direction, 0.0, 0.0, 0.0])]
    return tree.ComputeMassMatrixAndForceTerms([ANGLE, 0.4], [0.0, 0.0], externalForces=torques)[1]


along_z = force_terms((0.0, 0.0, 1.0))
assert np.abs(along_z - [1.0, 0.0]).max() < 1e-12  # the sign of the terms
right = np.array([0.0, np.sin(ANGLE)])  # shares along z and along the second axis, (cos, sin, 0)
print(np.abs(force_terms((0.0, 1.0, 0.0)) - right).max())
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "exudyn 1.13.6: stated 0.4818, seen $seen N m of 1 off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.4818) <= 0.04818)' "$seen" || {
    echo "This has changed."
    exit 1
}
