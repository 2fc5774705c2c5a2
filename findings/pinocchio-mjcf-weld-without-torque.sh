#!/usr/bin/env bash
# Finding pinocchio-mjcf-weld-without-torque: pin 4.1.0
#
# Does: A <weld> with torquescale="0" becomes a constraint of six equations, which also holds the bodies' orientation.
# Right: three equations: by MuJoCo's XML reference, a weld of torquescale 0 acts as a connect.
# Cause: The reader of MJCF does not read the attribute torquescale.
#
# Stated: 3 equations too many
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
import tempfile
from pathlib import Path

import pinocchio

BODY = '<body name="{0}" pos="{1} 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="of {0}"/></body>'
both = BODY.format("a", 0) + BODY.format("b", 1)
path = Path(tempfile.mkdtemp()) / "pair.xml"
path.write_text(
    f'<mujoco model="m"><worldbody><body name="r">{both}</body></worldbody><equality>'
    '<weld body1="a" body2="b" torquescale="0"/></equality></mujoco>'
)
model, points, frames = pinocchio.buildModelAndConstraintsFromMJCF(str(path))
print(3 * len(points) + 6 * len(frames) - 3)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 3, seen $seen equations too many"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 3) <= 0.3)' "$seen" || {
    echo "This has changed."
    exit 1
}
