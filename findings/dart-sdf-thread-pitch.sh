#!/usr/bin/env bash
# Finding dart-sdf-thread-pitch: dartpy 6.20.0
#
# Does: The <thread_pitch> of a screw joint in an SDF file is read as metres per turn: 3 gives a screw that moves by 3
#   m in a turn, without a message.
# Right: -2π/3 m per turn: <thread_pitch> has the unit rad/m and is positive for a left-handed thread, as libsdformat
#   reads it (pull request 1168 of gazebosim/sdformat, which adds <screw_thread_pitch> in m per turn).
# Cause: The number goes unchanged to ScrewJoint, whose pitch is in metres per turn.
#
# Stated: 5.094 m per turn off
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
import math
import tempfile
from pathlib import Path

import dartpy

path = Path(tempfile.mkdtemp()) / "screw.sdf"
path.write_text("""<sdf version="1.6"><model name="screw"><link name="nut"><inertial><mass>1</mass></inertial></link>
<joint name="thread" type="screw"><parent>world</parent><child>nut</child><thread_pitch>3</thread_pitch>
<axis><xyz>0 0 1</xyz></axis></joint></model></sdf>""")
joint = dartpy.utils.SdfParser.readSkeleton(str(path)).getJoint(0)
print(abs(joint.getPitch() - -2 * math.pi / 3))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "dartpy 6.20.0: stated 5.094, seen $seen m per turn off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 5.094) <= 0.5094)' "$seen" || {
    echo "This has changed."
    exit 1
}
