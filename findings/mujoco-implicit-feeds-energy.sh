#!/usr/bin/env bash
# Finding mujoco-implicit-feeds-energy: mujoco 4.0.0
#
# Does: The integrator implicit feeds energy into a slider-crank without losses, whose closure is hard, at the rate at
#   which Euler takes it: 0.74 % in 1 s at a step of 0.1 ms and 30 rad/s; Euler takes 0.67 %. At steps above 0.3 ms
#   the motion of a similar slider-crank becomes infinite.
# Right: a constant energy; RK4 has a trend of 8e-7 in 1 s at that step.
# Cause: The integrator is of first order, and its error has a sign. On open chains the signs of implicit and Euler
#   can be exchanged.
#
# Stated: 0.00741 of the energy gained in 1 s
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
<mujoco>
  <option timestep="1e-4" integrator="implicit"><flag refsafe="disable" energy="enable"/></option>
  <default><geom contype="0" conaffinity="0" size="0.02"/></default>
  <worldbody>
    <body><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0"/>
      <body pos="0.3 0 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.4 0 0"/>
        <site name="end" pos="0.4 0 0"/></body></body>
    <body pos="0.7 0 0"><joint type="slide" axis="1 0 0"/><geom size="0.05"/><site name="slider"/></body>
  </worldbody>
  <equality><connect site1="end" site2="slider" solref="-1e6 -2e3" solimp="0.9999 0.9999"/></equality>
</mujoco>
"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
data.qvel[:] = [30, -52.5, 0]
energies = []
for _ in range(101):
    mujoco.mj_forward(model, data)
    energies.append(data.energy.sum())
    mujoco.mj_step(model, data, nstep=100)
print(np.polyfit(np.linspace(0, 1, 101), energies, 1)[0] / energies[0])
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mujoco 4.0.0: stated 0.00741, seen $seen of the energy gained in 1 s"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.00741) <= 0.000741)' "$seen" || {
    echo "This has changed."
    exit 1
}
