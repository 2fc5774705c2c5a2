#!/usr/bin/env bash
# Finding pinocchio-impulse-of-two-joints: pin 4.1.0
#
# Does: impulseDynamics with a RigidConstraintModel between two moving joints leaves out the velocity of the second
#   joint: two carts of 1 kg and 3 kg at 0.5 and -0.5 m/s, which a point constraint joins, leave at 0.125 and -0.375
#   m/s.
# Right: -0.25 m/s each: momentum is constant, and the joined points move as one. impulseDynamics with the
#   constraint's Jacobian [1, -1] gives these velocities.
# Cause: The right-hand side of the impact has the first joint's velocity of the constraint only, so that the impulse
#   is half of the right one here. With the ground as the second joint it is right; with the ground as the first joint
#   the velocity does not change at all. crosscheck uses the form with the Jacobian.
#
# Stated: 0.375 m/s, of velocities of 0.5 m/s
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

model, here = pin.Model(), pin.SE3.Identity()
carts = [model.addJoint(0, pin.JointModelPX(), here, name) for name in ("light", "heavy")]
for cart, mass in zip(carts, (1.0, 3.0)):
    model.appendBodyToJoint(cart, pin.Inertia(mass, np.zeros(3), np.eye(3)), here)
q, v = np.zeros(2), np.array([0.5, -0.5])
models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
kind = pin.ContactType.CONTACT_3D
models.append(pin.RigidConstraintModel(kind, model, carts[0], here, carts[1], here, pin.LOCAL))
datas.append(models[0].createData())
data = model.createData()
pin.initConstraintDynamics(model, data, models, datas)
many = pin.ProximalSettings(1e-12, 1e-12, 1e-10, 100)
found = np.array(pin.impulseDynamics(model, data, q, v, models, datas, 0.0, many))
right = pin.impulseDynamics(model, model.createData(), q, v, np.array([[1.0, -1.0]]))
assert np.abs(right + 0.25).max() < 1e-12
print(np.abs(found - right).max())
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 0.375, seen $seen m/s, of velocities of 0.5 m/s"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.375) <= 0.0375)' "$seen" || {
    echo "This has changed."
    exit 1
}
