#!/usr/bin/env bash
# Finding pinocchio-mjcf-flags-ignored: pin 4.1.0
#
# Does: A model whose <flag limit="disable" frictionloss="disable"/> switches limits and dry friction off has both
#   after reading.
# Right: no limit and no friction: by MuJoCo's XML reference the flags switch these off in the whole model.
# Cause: The reader of MJCF reads no <flag>.
#
# Stated: 2 of a limit and a friction kept
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

path = Path(tempfile.mkdtemp()) / "hinge.xml"
path.write_text(
    '<mujoco model="m"><compiler angle="radian"/><option><flag limit="disable" frictionloss="disable"/></option>'
    '<worldbody><body name="b"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    '<joint name="h" range="-0.1 0.1" limited="true" frictionloss="0.3"/></body></worldbody></mujoco>'
)
model = pinocchio.buildModelFromMJCF(str(path))
print(int(model.upperPositionLimit[0] < 1.0) + int(model.upperDryFrictionLimit[0] > 0.0))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 2, seen $seen of a limit and a friction kept"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 2) <= 0.2)' "$seen" || {
    echo "This has changed."
    exit 1
}
