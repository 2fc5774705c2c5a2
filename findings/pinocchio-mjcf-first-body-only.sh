#!/usr/bin/env bash
# Finding pinocchio-mjcf-first-body-only: pin 4.1.0
#
# Does: Of several bodies in <worldbody> the reader of MJCF keeps the first one only, without a message.
# Right: two hinges, of both bodies. With one massless body around them Pinocchio has both.
# Cause: The tree of the model begins at the first child of the world; its other children are not visited.
#
# Stated: 1 joints missing
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
path = Path(tempfile.mkdtemp()) / "pair.xml"
both = BODY.format("a", 0) + BODY.format("b", 1)
path.write_text(f'<mujoco model="m"><worldbody>{both}</worldbody></mujoco>')
print(2 - pinocchio.buildModelFromMJCF(str(path)).nv)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 1, seen $seen joints missing"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
