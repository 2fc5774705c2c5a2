#!/usr/bin/env bash
# Finding roboticstoolbox-urdf-oblique-axis: roboticstoolbox-python 1.5.0
#
# Does: A joint of a URDF whose axis lies along none of x, y, z is read as another joint, without a message: its link
#   is turned by 1 rad about the axis at the angle 0, and turns about its own z axis.
# Right: at the angle 0 the link has the orientation of <origin>, whatever the axis is: a point 1 m above the hinge is
#   there. Axes along x, y and z give that.
# Cause: The reader turns the frame by angvec2r(n, u), with n the length of the axis, as an angle, and u the axis,
#   where a rotation of z onto the axis and its inverse behind the joint are needed. Pull request 441 of
#   petercorke/robotics-toolbox-python corrects it (closed, not merged).
#
# Stated: 0.95885 m off, of 1 m
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q roboticstoolbox-python==1.5.0 numpy

cat > "$place/proof.py" <<'END'
import tempfile
import warnings
from pathlib import Path

import numpy as np
from roboticstoolbox import Robot
from roboticstoolbox.models.URDF.URDFRobot import URDF_read

warnings.simplefilter("ignore")


def tool(axis):
    """Return the place of a link 1 m above a hinge, at the angle 0."""
    ends = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="0 0 {4}"/>{5}</joint>'
    hinge = ends.format("hinge", "continuous", "base", "arm", 0, f'<axis xyz="{axis}"/>')
    links = "".join(f'<link name="{name}"/>' for name in ("base", "arm", "tool"))
    path = Path(tempfile.mkdtemp()) / "robot.urdf"
    path.write_text(
        f'<robot name="r">{links}{hinge}{ends.format("end", "fixed", "arm", "tool", 1, "")}</robot>'
    )
    parts, name, *_ = URDF_read(path)
    return Robot(parts, name=name).fkine([0.0], end="tool").t


right = np.array([0.0, 0.0, 1.0])
assert np.abs(tool("0 1 0") - right).max() < 1e-12
print(np.linalg.norm(tool("0.6 0.8 0") - right))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "roboticstoolbox-python 1.5.0: stated 0.95885, seen $seen m off, of 1 m"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.95885) <= 0.095885)' "$seen" || {
    echo "This has changed."
    exit 1
}
