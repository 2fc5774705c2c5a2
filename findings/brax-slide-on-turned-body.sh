#!/usr/bin/env bash
# Finding brax-slide-on-turned-body: brax 0.14.2
#
# Does: The pipeline generalized has wrong dynamics of a sliding joint on a body that has turned: a slide on an arm
#   that turns at 3 rad/s, 2 m from the hinge, is not thrown outwards once the arm has turned by 90°. The mass matrix
#   couples the two joints there, by -2 kg m.
# Right: ω² r = 18 m/s² at every angle, and a mass matrix without coupling; Brax has both at the angle 0, and its
#   pipelines spring and positional have the acceleration at both angles. Hinges behind hinges, slides on the ground
#   and free joints agree with MuJoCo to 1e-12.
# Cause: transform_com in brax/generalized/dynamics.py turns the angular part of a joint's axis into the world
#   (math.rotate of cdof.ang), and leaves the part of the translation in the axes of the parent.
#
# Stated: 18 m/s² of 18 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q brax==0.14.2 numpy

cat > "$place/proof.py" <<'END'
import jax
import numpy as np
from jax import numpy as jnp

jax.config.update("jax_enable_x64", True)
from brax.generalized import pipeline
from brax.io import mjcf

SPEED, DISTANCE = 3.0, 2.0  # rad/s, m
MODEL = """<mujoco><option gravity="0 0 0" timestep="1e-4"/><worldbody>
<body><joint axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<geom size="0.1" contype="0" conaffinity="0"/>
<body><joint type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body>
</worldbody></mujoco>"""
system = mjcf.loads(MODEL)


def acceleration(angle):
    """Return the acceleration of the slide along the arm, which is turned by an angle and turns."""
    state = pipeline.init(system, jnp.array([angle, DISTANCE]), jnp.array([SPEED, 0.0]))
    return float(pipeline.step(system, state, jnp.zeros(0)).qd[1]) / system.opt.timestep


right = SPEED**2 * DISTANCE
assert abs(acceleration(0.0) - right) < 1e-6
print(right - acceleration(np.pi / 2))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "brax 0.14.2: stated 18, seen $seen m/s² of 18 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 18.0) <= 1.8)' "$seen" || {
    echo "This has changed."
    exit 1
}
