#!/usr/bin/env bash
# Finding mujoco-sleep-at-fine-steps: mujoco 4.0.0
#
# Does: With sleep enabled, a pendulum that is released from rest does not start at a step of 1 µs: after 2000 steps
#   it has moved by 2e-5 of its way. At 3 µs it starts.
# Right: the way of a pendulum of 46.7 rad/s² in 2 ms. Without sleep MuJoCo has it.
# Cause: A body whose speed stays below sleep_tolerance for ten steps falls asleep, and loses its speed. From rest it
#   has 10 × step × acceleration after ten steps, so that it never starts below a step of about tolerance / (10 ×
#   acceleration). Set sleep_tolerance in proportion to the step, or no sleep.
#
# Stated: 1 of the way not made
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

MODEL = """
<mujoco>
  <option timestep="1e-6"><flag sleep="enable"/></option>
  <worldbody>
    <body><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/></body>
  </worldbody>
</mujoco>
"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
should = data.qacc[0] * 0.002**2 / 2
mujoco.mj_step(model, data, nstep=2000)
print(1 - data.qpos[0] / should)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mujoco 4.0.0: stated 1, seen $seen of the way not made"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.0) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
