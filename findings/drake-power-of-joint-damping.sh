#!/usr/bin/env bash
# Finding drake-power-of-joint-damping: drake 1.51.1
#
# Does: MultibodyPlant.CalcNonConservativePower leaves out the damping of joints: for a cart of 2 kg at 3 m/s on a
#   slide with a damping of 0.5 N s/m it gives 0.
# Right: -4.5 W, the rate of the energy (kinetic and potential) by the accelerations of EvalTimeDerivatives. The power
#   of the force elements DoorHinge and LinearSpringDamper is counted.
# Cause: Only force elements report a power, and the damping of joints is none of them (Drake's issue 12942). Every
#   joint with damping is concerned. crosscheck takes powers from its own judge.
#
# Stated: 4.5 W
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q drake==1.51.1 numpy

cat > "$place/proof.py" <<'END'
import numpy as np
from pydrake.all import MultibodyPlant, PrismaticJoint, SpatialInertia, UnitInertia

MASS, SPEED = 2.0, 3.0


def difference(damping):
    plant = MultibodyPlant(0.0)
    cart = plant.AddRigidBody("cart", SpatialInertia(MASS, np.zeros(3), UnitInertia(1.0, 1.0, 1.0)))
    frames = plant.world_frame(), cart.body_frame()
    plant.AddJoint(PrismaticJoint("slide", *frames, [1, 0, 0], damping=damping))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetVelocities(context, [SPEED])
    [acceleration] = plant.EvalTimeDerivatives(context).get_generalized_velocity().CopyToVector()
    return abs(MASS * acceleration * SPEED - plant.CalcNonConservativePower(context))


assert difference(0.0) < 1e-12
print(difference(0.5))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "drake 1.51.1: stated 4.5, seen $seen W"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 4.5) <= 0.45)' "$seen" || {
    echo "This has changed."
    exit 1
}
