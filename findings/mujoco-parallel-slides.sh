#!/usr/bin/env bash
# Finding mujoco-parallel-slides: mujoco 4.0.0
#
# Does: The mass matrix of a body with two slides along one line, at the world, lacks its off-diagonal terms: a mass
#   of 0.5 kg on a slide with an armature of 2 kg and a second slide accelerates as if the slides moved two bodies.
# Right: M = [[2.5, 0.5], [0.5, 0.5]] kg, since the mass moves with the sum of both displacements; with the axes 1e-6
#   rad apart, MuJoCo itself has this matrix.
# Cause: The compiler marks a body whose slides are along axes of its frame as simple (body_simple), and a simple
#   body's mass matrix is taken as diagonal, although two of the axes are equal.
#
# Stated: 0.5 kg of 0.5 lost
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

slides = '<joint type="slide" axis="0 0 1" armature="2"/><joint type="slide" axis="0 0 1"/>'
body = f'<body>{slides}<geom type="sphere" size="0.05" mass="0.5"/></body>'
model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
data, mass = mujoco.MjData(model), np.zeros((2, 2))
mujoco.mj_forward(model, data)
mujoco.mj_fullM(model, data, mass)
print(0.5 - mass[0, 1])
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mujoco 4.0.0: stated 0.5, seen $seen kg of 0.5 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.5) <= 0.05)' "$seen" || {
    echo "This has changed."
    exit 1
}
