#!/usr/bin/env bash
# Finding pinocchio-coriolis-matrix-of-mimic: pin 4.1.0
#
# Does: computeCoriolisMatrix of a model with a mimic joint gives a matrix C with another C v than rnea: a torque of
#   0.386 N m for 3.095 N m. It gives no error, while aba, dccrba and the derivatives refuse such models.
# Right: C v is nonLinearEffects minus the gravity torques, which equal the reduction of the model without mimic to
#   rounding, and v' (dM/dt - 2 C) v = 0. Without the mimic joint both hold.
# Cause: The function does not support mimic joints: it has an assertion, which released packages leave out, and not
#   the exception that aba has. C v from rnea is right.
#
# Stated: 2.709 N m, of a torque of 3.1 N m
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


def link(name):
    parts = '<mass value="1"/><inertia ixx=".1" iyy=".2" izz=".3" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><origin xyz=".1 .2 .2"/>{parts}</inertial></link>'


def hinge(child, parent, axis, more=""):
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz=".3 .2 .1"/><axis xyz="{axis}"/>'
    limit = '<limit lower="-3" upper="3" effort="9" velocity="9"/>'
    return f'<joint name="{child}" type="revolute">{ends}{limit}{more}</joint>'


def difference(follows):
    joints = hinge("a", "base", "1 0 0") + hinge("b", "a", "0 1 0") + hinge("c", "b", "0 0 1", follows)
    text = f'<robot name="r"><link name="base"/>{link("a")}{link("b")}{link("c")}{joints}</robot>'
    model = pin.buildModelFromXML(text, mimic=True)
    q, v = np.array([[0.3, 0.4, 0.9], [1.0, 2.0, 2.0]])[:, : model.nv]
    data = model.createData()
    right = pin.rnea(model, data, q, v, 0 * v) - pin.rnea(model, data, q, 0 * v, 0 * v)
    return np.abs(pin.computeCoriolisMatrix(model, model.createData(), q, v) @ v - right).max()


assert difference("") < 1e-12
print(difference('<mimic joint="a" multiplier="2" offset="0.3"/>'))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 2.709, seen $seen N m, of a torque of 3.1 N m"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 2.709) <= 0.2709)' "$seen" || {
    echo "This has changed."
    exit 1
}
