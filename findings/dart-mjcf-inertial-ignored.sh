#!/usr/bin/env bash
# Finding dart-mjcf-inertial-ignored: dartpy 6.20.0
#
# Does: DART's reader of MJCF ignores <inertial>: each body without shapes has 1 kg and unit moments of inertia,
#   without a message.
# Right: the mass of the file, 2 kg.
# Cause: Masses and centres follow from the shapes alone, and moments of inertia stay at their default of 1 kg m².
#
# Stated: 1 kg of 2 kg off
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q dartpy==6.20.0 numpy

cat > "$place/proof.py" <<'END'
import tempfile
from pathlib import Path

import dartpy

path = Path(tempfile.mkdtemp()) / "arm.xml"
path.write_text("""<mujoco model="arm"><worldbody><body name="upper" pos="0 0 .4">
<inertial pos="0 0 .2" mass="2" diaginertia=".03 .04 .02"/><joint name="first" axis="0 1 0"/>
</body></worldbody></mujoco>""")
world = dartpy.utils.MjcfParser.readWorld(str(path))
print(abs(world.getSkeleton(0).getBodyNode(0).getMass() - 2.0))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "dartpy 6.20.0: stated 1, seen $seen kg of 2 kg off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
