#!/usr/bin/env bash
# Finding pinocchio-lcaba-typical-mu: pin 4.1.0
#
# Does: Accelerations by lcaba are off by about 1e-3 on a loop of three bodies with ball joints, at rest and 1 m from
#   the origin, at the typical mu of 1e-6; with mu = 1e-4 by about 1e-6, and with mu = 1e-8 by more than the largest
#   acceleration. More iterations change nothing, and no message says so.
# Right: the accelerations by constraintDynamics, which are equal to 1e-12 for every mu from 1e-2 to 1e-8; lcaba with
#   mu = 1e-2 is right to 1e-10.
# Cause: The error grows with 1/mu²: inertias of constraints, of size 1/mu, stand beside the inertias of the links in
#   the recursion, and their rounding is divided by mu once more. Take a mu of 1e-2 with more iterations.
#
# Stated: more than 1e-06 of the largest acceleration off
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

JOINTS = ("RZ", (0.0, 0.0, 0.0)), ("Spherical", (1.0, 0.0, 0.0)), ("Spherical", (1.0, 0.5, 0.5))
INERTIA = pin.Inertia(1.0, np.array([0.4, 0.1, 0.2]), np.diag([0.05, 0.06, 0.07]))
END = np.array([0.5, 0.2, 0.3])
model, joint = pin.Model(), 0
for kind, place in JOINTS:
    frame = pin.SE3(np.eye(3), np.array(place))
    joint = model.addJoint(joint, getattr(pin, f"JointModel{kind}")(), frame, f"at {place}")
    model.appendBodyToJoint(joint, INERTIA, pin.SE3.Identity())
q, still, data = pin.neutral(model), np.zeros(model.nv), model.createData()
pin.forwardKinematics(model, data, q)
ends = [pin.SE3(np.eye(3), point) for point in (END, data.oMi[joint].act(END))]
kind, local = pin.ContactType.CONTACT_3D, pin.ReferenceFrame.LOCAL
loop = pin.RigidConstraintModel(kind, model, joint, ends[0], 0, ends[1], local)


def accelerations(dynamics, mu):
    """Return the accelerations of the loop at rest."""
    loops, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    loops.append(loop)
    datas.append(loop.createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, loops, datas)
    pin.computeJointMinimalOrdering(model, data, loops)
    settings = pin.ProximalSettings(1e-9, mu, 200)
    return dynamics(model, data, q, still, still, loops, datas, settings).copy()


right = accelerations(pin.constraintDynamics, 1e-6)
for dynamics, mu in ((pin.constraintDynamics, 1e-2), (pin.lcaba, 1e-2)):
    assert np.abs(accelerations(dynamics, mu) - right).max() < 1e-8 * np.abs(right).max()
print(np.abs(accelerations(pin.lcaba, 1e-6) - right).max() / np.abs(right).max())
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated more than 1e-06, seen $seen of the largest acceleration off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not seen > 1e-06)' "$seen" || {
    echo "This has changed."
    exit 1
}
