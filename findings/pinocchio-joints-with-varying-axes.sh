#!/usr/bin/env bash
# Finding pinocchio-joints-with-varying-axes: pin 4.1.0
#
# Does: Derivatives, Coriolis matrix and the rate of the Jacobian are wrong beside a joint whose axes change with its
#   coordinates: JointModelUniversal, SphericalZYX, Ellipsoid and Composite. dtau_dq of computeRNEADerivatives is off
#   by 0.8 to 1.4 times its largest entry, C v by 14 to 57 %, the Jacobian's rate by 19 to 47 %.
#   computeABADerivatives, computeGeneralizedGravityDerivatives, dccrba and the centroidal derivatives are off alike.
#   No error is raised.
# Right: central differences of rnea and of the Jacobian, and rnea itself for C v. Joints with axes fixed in the child
#   (hinges, sliding, screw, spherical, planar and free joints) agree to 1e-8; rnea, aba and crba are right for all
#   types.
# Cause: The formulas take the joint's motion subspace as constant in the child's frame. A part of it is known as
#   issue 2053 of stack-of-tasks/pinocchio (C v of SphericalZYX, open since 2023). Hinges in series without a body
#   between them are the same joint, and right.
#
# Stated: 1.195 of the largest entry of dtau_dq, beside JointModelUniversal
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

X, Y, STEP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), 1e-6


def composite():
    joint = pin.JointModelComposite(pin.JointModelRX())
    joint.addJoint(pin.JointModelPY(), pin.SE3.Identity())
    return joint


def errors(joint):
    """Return relative errors of dtau_dq, of C v, and of the rate of the Jacobian, for a joint and a hinge."""
    model = pin.Model()
    for kind in (joint, pin.JointModelRY()):
        place = pin.SE3(pin.exp3(np.array([0.3, 0.2, 0.1])), np.array([0.1, 0.2, 0.3]))
        link = model.addJoint(model.njoints - 1, kind, place, str(model.njoints))
        inertia = pin.Inertia(1.0, np.array([0.5, 0.2, 0.1]), np.diag([0.1, 0.2, 0.25]))  # kg, m, kg m²
        model.appendBodyToJoint(link, inertia, pin.SE3.Identity())
    q = pin.integrate(model, pin.neutral(model), np.linspace(0.3, 0.9, model.nv))
    v, a = np.linspace(-1.0, 2.0, model.nv), np.linspace(1.0, 2.0, model.nv)

    def differences(of, direction):
        there, back = (of(pin.integrate(model, q, s * direction)) for s in (STEP, -STEP))
        return (there - back) / (2 * STEP)

    def torques(q):
        return pin.rnea(model, model.createData(), q, v, a).copy()

    def jacobian(q):
        data = model.createData()
        pin.computeJointJacobians(model, data, q)
        return pin.getJointJacobian(model, data, 2, pin.LOCAL).copy()

    data = model.createData()
    pin.computeRNEADerivatives(model, data, q, v, a)
    right = np.array([differences(torques, e) for e in np.eye(model.nv)]).T
    stated = [(data.dtau_dq.copy(), right)]
    bias = pin.rnea(model, data, q, v, 0 * v) - pin.rnea(model, data, q, 0 * v, 0 * v)
    stated.append((pin.computeCoriolisMatrix(model, model.createData(), q, v) @ v, bias))
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    rate = pin.getJointJacobianTimeVariation(model, data, 2, pin.LOCAL)
    stated.append((rate, differences(jacobian, v)))
    return [np.abs(x - y).max() / np.abs(y).max() for x, y in stated]


fixed = [pin.JointModelRX(), pin.JointModelSpherical(), pin.JointModelPlanar(), pin.JointModelFreeFlyer()]
for joint in fixed:
    assert max(errors(joint)) < 1e-7
universal, euler = pin.JointModelUniversal(X, Y), pin.JointModelSphericalZYX()
varying = [universal, euler, pin.JointModelEllipsoid(0.3, 0.2, 0.1), composite()]
found = np.array([errors(joint) for joint in varying])
assert found.min() > 0.01
print(found[0, 0])
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 1.195, seen $seen of the largest entry of dtau_dq, beside JointModelUniversal"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.195) <= 0.1195)' "$seen" || {
    echo "This has changed."
    exit 1
}
