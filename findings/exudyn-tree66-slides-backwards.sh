#!/usr/bin/env bash
# Finding exudyn-tree66-slides-backwards: exudyn 1.13.6
#
# Does: KinematicTree66 moves a prismatic joint (Px, Py, Pz) the wrong way: a slide on a turning arm, 2 m out, with
#   its point 0.5 m further on, has the moment of inertia of a point 1.5 m on the other side. Mass matrix and forces
#   are wrong in trees with hinges before slides.
# Right: (2 + 0.5)² kg m² for a point of 1 kg. A hinge behind a fixed distance of 2 m has it, and ObjectKinematicTree
#   of Exudyn's C++ library has the motion.
# Cause: Translation2T66 has the sign of an inverse transformation, unlike RotationTranslation2T66 and the rotations,
#   and TranslationX2T66Inverse, …Y, …Z invert it once more. Trees of hinges alone are right.
#
# Stated: 4 kg m² of 6.25 off
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
from exudyn.rigidBodyUtilities import RotationTranslation2T66Inverse

DISTANCE, CENTRE = 2.0, 0.5  # m along the arm, and of the point from the second joint's frame
UNIT = np.eye(3)
point, nothing = MassCOMinertia2T66(1.0, [CENTRE, 0.0, 0.0], 0 * UNIT), np.zeros((6, 6))


def moment(joint, coordinate, place):
    """Return the moment of inertia about z of a point of 1 kg behind a joint at a place (m) on a turning arm."""
    frames = [RotationTranslation2T66Inverse(UNIT, [x, 0.0, 0.0]) for x in (0.0, place)]
    tree = KinematicTree66(["Rz", joint], frames, [nothing, point], gravity=[0.0, 0.0, 0.0])
    return tree.ComputeMassMatrixAndForceTerms([0.0, coordinate], [0.0, 0.0])[0][0, 0]


right = (DISTANCE + CENTRE) ** 2
assert abs(moment("Rz", 0.0, DISTANCE) - right) + abs(moment("Px", 0.0, DISTANCE) - right) < 1e-12
print(right - moment("Px", DISTANCE, 0.0))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "exudyn 1.13.6: stated 4, seen $seen kg m² of 6.25 off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 4.0) <= 0.4)' "$seen" || {
    echo "This has changed."
    exit 1
}
