#!/usr/bin/env bash
# Finding pinocchio-urdf-plane-of-planar-joint: pin 4.1.0
#
# Does: A planar joint of a URDF file with <axis xyz="0 1 0"/> slides along y, the normal of its plane.
# Right: it stays in the plane normal to the axis, by the URDF specification: x and z.
# Cause: The reader makes a joint of the plane normal to z whatever the axis is, without a message.
#
# Stated: 1 m along the normal at a coordinate of 1 m
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

import numpy
import pinocchio

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
LINK = f'<link name="{{}}"><inertial><mass value="1"/>{INERTIA}</inertial></link>'
path = Path(tempfile.mkdtemp()) / "table.urdf"
path.write_text(
    f'<robot name="r">{LINK.format("a")}{LINK.format("b")}<joint name="j" type="planar">'
    '<parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>'
)
model = pinocchio.buildModelFromUrdf(str(path))
data = model.createData()
along = []
for x, y in ((1.0, 0.0), (0.0, 1.0)):
    pinocchio.forwardKinematics(model, data, numpy.array([x, y, 1.0, 0.0]))
    along.append(abs(data.oMi[1].translation[1]))
print(max(along))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pin 4.1.0: stated 1, seen $seen m along the normal at a coordinate of 1 m"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.0) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
