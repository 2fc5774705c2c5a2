#!/usr/bin/env bash
# Finding mujoco-jacdot-slide-behind-ball: mujoco 4.0.0
#
# Does: The time derivative of a Jacobian, mj_jacDot, is wrong for a body with a ball joint and then a slide: its
#   product with the joint velocities is 0.95 m/s² off.
# Right: The difference of mj_jac along mj_integratePos. With a ball alone, and with the slide before the ball,
#   mj_jacDot agrees with it.
# Cause: It takes the velocity of the whole body, to which the slide contributes, for the velocity of the ball's axes,
#   which turn and move before the slide.
#
# Stated: 0.9462 m/s² off
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q mujoco==4.0.0 numpy

cat > "$place/proof.py" <<'END'
import mujoco
import numpy as np

MODEL = """
<mujoco><worldbody>
  <body><joint type="ball"/><joint type="slide" axis="1 0 0"/>
    <inertial pos=".3 .1 .2" mass="1" diaginertia="1 1 1"/></body>
</worldbody></mujoco>
"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
data.qpos[4] = 0.4
data.qvel[:] = 0.3, -0.7, 0.5, 1.1
mujoco.mj_forward(model, data)
point = np.array([0.7, 0.2, 0.1])
on_body = data.xmat[1].reshape(3, 3).T @ (point - data.xpos[1])
rate = np.zeros((3, model.nv))
mujoco.mj_jacDot(model, data, rate, None, point, 1)


def jacobian(seconds):
    moved, found = mujoco.MjData(model), np.zeros((3, model.nv))
    moved.qpos[:] = data.qpos
    mujoco.mj_integratePos(model, moved.qpos, data.qvel, seconds)
    mujoco.mj_forward(model, moved)
    mujoco.mj_jac(model, moved, found, None, moved.xpos[1] + moved.xmat[1].reshape(3, 3) @ on_body, 1)
    return found


exact = (jacobian(1e-6) - jacobian(-1e-6)) / 2e-6
print(np.linalg.norm((rate - exact) @ data.qvel))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mujoco 4.0.0: stated 0.9462, seen $seen m/s² off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.9462) <= 0.09462)' "$seen" || {
    echo "This has changed."
    exit 1
}
