#!/usr/bin/env bash
# Finding mjx-connect-without-velocity-term: mujoco-mjx 3.17.0
#
# Does: MJX leaves the term of the velocities, J' v, out of the reference acceleration of `connect`: loops that move
#   are pulled open, and accelerations are off.
# Right: the reference acceleration of MuJoCo in C of the same model and state, -J' v where the closure holds (here
#   1.08 m/s²; MJX has 4e-13), as J a + J' v = 0 demands. MuJoCo Warp has the term.
# Cause: efc_aref of an equality of type connect is -b J v - k r in MJX, without -J' v.
#
# Stated: 1.08 m/s² off
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q mujoco-mjx==3.17.0 numpy

cat > "$place/proof.py" <<'END'
import jax
import mujoco
import numpy as np

jax.config.update("jax_enable_x64", True)
from mujoco import mjx

MODEL = """
<mujoco><option gravity="0 -9.81 0"/><worldbody>
 <body name="a"><joint axis="0 0 1"/><inertial pos="0 .15 0" mass="1" diaginertia=".02 .01 .02"/>
  <body name="b" pos="0 .3 0"><joint axis="0 0 1"/>
   <inertial pos=".35 .1 0" mass="2" diaginertia=".05 .05 .05"/></body></body>
 <body name="c" pos=".7 0 0"><joint axis="0 0 1"/>
  <inertial pos="0 .25 0" mass="1.5" diaginertia=".02 .01 .02"/></body>
</worldbody><equality><connect body1="b" body2="c" anchor=".7 .2 0"/></equality></mujoco>"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
rows = data.efc_J.reshape(-1, model.nv)[:3]
data.qvel[:] = 3.0, *np.linalg.lstsq(rows[:, 1:], -3.0 * rows[:, 0], rcond=None)[0]  # the loop stays closed
mujoco.mj_forward(model, data)
there = jax.jit(mjx.forward)(mjx.put_model(model), mjx.put_data(model, data))
print(abs(np.array(there._impl.efc_aref)[:3] - data.efc_aref[:3]).max())
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mujoco-mjx 3.17.0: stated 1.08, seen $seen m/s² off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.08) <= 0.108)' "$seen" || {
    echo "This has changed."
    exit 1
}
