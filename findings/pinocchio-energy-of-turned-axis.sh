#!/usr/bin/env bash
# Finding pinocchio-energy-of-turned-axis: pin 4.1.0
#
# Does: computeKineticEnergy and computeAllTerms leave out the armature of a hinge or screw whose axis lies along none
#   of x, y, z (RevoluteUnaligned, HelicalUnaligned): 78 % of the energy of a wheel of 0.1 kg m² with an armature of
#   0.35 kg m². The energy of a run then drifts, as if a motor did work. 3.9.0 does so, too.
# Right: v M v / 2 with M from crba, which has the armature, as rnea and aba have. The function agrees with it on axes
#   along x, y, z, and on sliding joints along any axis.
# Cause: The term of the armature is there for other joint types. Take v M v / 2.
#
# Stated: 0.7778 of the kinetic energy
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q pin==4.1.0 numpy

cat > "$place/proof.py" <<'END'
import numpy as np
import pinocchio as pin

AXIS, SPEED, ARMATURE = np.array([0.6, 0.0, 0.8]), np.array([2.0]), np.array([0.35])  # rad/s, kg m²


def share(joint, inertia):
    """Return the share of the kinetic energy v M v / 2 that computeKineticEnergy leaves out."""
    model = pin.Model()
    model.appendBodyToJoint(model.addJoint(0, joint, pin.SE3.Identity(), "j"), inertia, pin.SE3.Identity())
    model.armature, q = ARMATURE, np.array([0.3])
    energy = (SPEED @ pin.crba(model, model.createData(), q) @ SPEED) / 2
    return 1 - pin.computeKineticEnergy(model, model.createData(), q, SPEED) / energy


wheel = pin.Inertia(1.0, np.zeros(3), np.eye(3) * 0.1)  # kg, m, kg m²: alike about all axes
for right in (pin.JointModelRX(), pin.JointModelPX(), pin.JointModelPrismaticUnaligned(AXIS)):
    assert abs(share(right, wheel)) < 1e-12
print(share(pin.JointModelRevoluteUnaligned(AXIS), wheel))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 0.7778, seen $seen of the kinetic energy"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.7778) <= 0.07778)' "$seen" || {
    echo "This has changed."
    exit 1
}
