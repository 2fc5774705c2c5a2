#!/usr/bin/env bash
# Finding pinocchio-mjcf-inactive-equality: pin 4.1.0
#
# Does: A <connect> with active="false" becomes a constraint of the model.
# Right: no constraint: MJCF's equality that is not active has no effect.
# Cause: The reader of MJCF does not read the attribute active.
#
# Stated: 1 constraints too many
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
    '<connect body1="a" body2="b" anchor="0 0 0" active="false"/></equality></mujoco>'
)
model, points, frames = pinocchio.buildModelAndConstraintsFromMJCF(str(path))
print(len(points) + len(frames))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 1, seen $seen constraints too many"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
