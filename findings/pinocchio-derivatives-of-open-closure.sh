#!/usr/bin/env bash
# Finding pinocchio-derivatives-of-open-closure: pin 4.1.0
#
# Does: computeConstraintDynamicsDerivatives of a closure CONTACT_6D in LOCAL_WORLD_ALIGNED with a Baumgarte term
#   gives a wrong ddq_dq while the closure is open: off by 0.7 % of the largest derivative at a gap of 1 cm, 6.9 % at
#   10 cm, 12 % at 0.1 rad.
# Right: central differences of constraintDynamics. The frame LOCAL agrees with them to 1e-8 at the same gaps, and
#   both frames do where the closure is met or has no Baumgarte term.
# Cause: The derivative of the closure's logarithm is that of the frame LOCAL, and is not turned into the world's
#   axes. The error grows in proportion to gap and Kp. Use LOCAL.
#
# Stated: 0.0689 of the largest derivative, at a gap of 0.1 m
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

STEP = 1e-6  # rad, of central differences, whose error is 1e-9 of the largest derivative


def two_arms(links):
    """Return two arms of hinges on the ground, about y, x, y, ..., and their last joints."""
    model, ends = pin.Model(), []
    for side in (0.0, 1.0):
        joint = 0
        for k in range(links):
            turn = pin.exp3(np.array([0.3, 0.2 + side, 0.1 * k]))
            place = pin.SE3(turn, np.array([side * (k == 0), 0.4, 0.1 * k]))
            hinge = pin.JointModelRX() if k % 2 else pin.JointModelRY()
            joint = model.addJoint(joint, hinge, place, f"{side}{k}")
            inertia = pin.Inertia(1.0, np.array([0.1, 0.2, 0.0]), np.diag([0.1, 0.2, 0.25]))
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        ends.append(joint)
    return model, ends


def errors(links, kind, frame, gap=0.0, stiffness=0.0):
    """Return the error of ddq_dq by column, relative to the largest derivative by differences. The closure
    of the arms' tips is open by a gap (m) and has a Baumgarte term (1/s²)."""
    model, (first, second) = two_arms(links)
    q, still, data = np.linspace(0.2, 0.9, model.nq), np.zeros(model.nv), model.createData()
    pin.forwardKinematics(model, data, q)
    tip = pin.SE3(np.eye(3), np.array([0.0, 0.4, 0.0]))
    other = data.oMi[second].actInv(data.oMi[first]) * tip * pin.SE3(np.eye(3), np.array([0.0, gap, 0.0]))
    closures = pin.StdVec_RigidConstraintModel()
    closures.append(pin.RigidConstraintModel(kind, model, first, tip, second, other, frame))
    closures[0].setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(stiffness, 0.0))
    settings = pin.ProximalSettings(1e-14, 0.0, 1)

    def solved(q):
        data, forces = model.createData(), pin.StdVec_RigidConstraintData()
        forces.append(closures[0].createData())
        pin.initConstraintDynamics(model, data, closures, forces)
        acceleration = pin.constraintDynamics(model, data, q, still, still, closures, forces, settings).copy()
        pin.computeConstraintDynamicsDerivatives(model, data, closures, forces, settings)
        return acceleration, data.ddq_dq.copy()

    columns = [(solved(q + e)[0] - solved(q - e)[0]) / (2 * STEP) for e in STEP * np.eye(model.nv)]
    right = np.array(columns).T
    return np.abs(solved(q)[1] - right).max(axis=0) / np.abs(right).max()


weld, frames = pin.ContactType.CONTACT_6D, (pin.LOCAL, pin.LOCAL_WORLD_ALIGNED)
local, aligned = (errors(4, weld, frame, gap=0.1, stiffness=100.0) for frame in frames)
assert max(*local, *errors(4, weld, frames[1], stiffness=100.0)) < 1e-7
print(aligned.max())
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 0.0689, seen $seen of the largest derivative, at a gap of 0.1 m"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.0689) <= 0.00689)' "$seen" || {
    echo "This has changed."
    exit 1
}
