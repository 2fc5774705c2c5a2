#!/usr/bin/env bash
# Finding newton-mjcf-gravity: newton 1.8.0
#
# Does: The gravity of an MJCF file, <option gravity>, is ignored: the model keeps 9.81 m/s² downwards.
# Right: (0, -5, 0) m/s², as in the file. The flag that disables gravity is read.
# Cause: The importer reads the options of MuJoCo's solver, and not this one.
#
# Stated: 11.01 m/s² off
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q newton==1.8.0 numpy

cat > "$place/proof.py" <<'END'
import tempfile
from pathlib import Path

import newton
import numpy as np

path = Path(tempfile.mkdtemp()) / "arm.xml"
path.write_text("""<mujoco model="arm"><option gravity="0 -5 0"/><worldbody><body name="upper">
<inertial pos="0 0 .2" mass="2" diaginertia=".03 .04 .02"/><joint name="first" axis="0 1 0"/>
</body></worldbody></mujoco>""")
builder = newton.ModelBuilder()
builder.add_mjcf(str(path))
print(float(np.linalg.norm(np.array(builder.gravity) - [0.0, -5.0, 0.0])))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "newton 1.8.0: stated 11.01, seen $seen m/s² off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 11.01) <= 1.101)' "$seen" || {
    echo "This has changed."
    exit 1
}
