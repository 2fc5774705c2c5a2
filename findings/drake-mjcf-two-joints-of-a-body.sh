#!/usr/bin/env bash
# Finding drake-mjcf-two-joints-of-a-body: drake 1.51.1
#
# Does: In an MJCF body with two hinges, the first hinge passes through the origin of the parent instead of the body.
# Right: both hinges at the body's place, 0.4 m above the world's origin, as MJCF demands and MuJoCo has: the moment
#   of inertia about the first one is 0.88 kg m²; Drake has 2.8 kg m².
# Cause: The place of the body is applied to the last joint only; an auxiliary body between the joints stays at the
#   parent's origin.
#
# Stated: 1.92 kg m² of 0.88 off
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
import tempfile
from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

MODEL = """<mujoco model="arm"><worldbody><body name="upper" pos="0 0 .4">
<inertial pos="0 0 .2" mass="2" diaginertia=".03 .04 .02"/>
<joint name="first" axis="0 1 0"/><joint name="second" axis="1 0 0"/>
<body name="lower" pos="0 0 .4"><inertial pos="0 0 .2" mass="2" diaginertia=".03 .04 .02"/>
<joint name="elbow" axis="0 1 0"/></body></body></worldbody></mujoco>"""
path = Path(tempfile.mkdtemp()) / "arm.xml"
path.write_text(MODEL)
plant = MultibodyPlant(0.0)
Parser(plant).AddModels(str(path))
plant.Finalize()
print(abs(plant.CalcMassMatrix(plant.CreateDefaultContext())[0, 0] - 0.88))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "drake 1.51.1: stated 1.92, seen $seen kg m² of 0.88 off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.92) <= 0.192)' "$seen" || {
    echo "This has changed."
    exit 1
}
