#!/usr/bin/env bash
# Finding roboticstoolbox-fixed-link-between-hinges: roboticstoolbox-python 1.5.0
#
# Does: rne, gravload and inertia of a robot from a URDF leave out the distance along a fixed link between two joints:
#   a point 1.5 m from the first hinge counts as 0.5 m from it, where 1 m of that is behind a fixed joint.
# Right: (1 + 1.5) g = 24.5 N m for 1 kg at 1 m and 1 kg at 1.5 m on a horizontal arm, which the same arm has without
#   a fixed joint. fkine and jacob0 are right for both.
# Cause: The recursion takes the transformation of the joint's own link (joint.A) from the preceding joint's frame,
#   and not the transformations of fixed links between them. Related: issues 483 and 636 of petercorke/robotics-
#   toolbox-python, on the masses of fixed links.
#
# Stated: 9.81 N m of 24.5 lost
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
G = 9.81  # m/s²
INERTIA = '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
LINK = f'<link name="{{}}"><inertial><origin xyz="0 0 {{}}"/><mass value="{{}}"/>{INERTIA}</inertial></link>'
JOINT = (
    '<joint name="{1}" type="{2}"><parent link="{0}"/><child link="{1}"/><origin xyz="0 0 {3}"/>{4}</joint>'
)
AXIS = '<axis xyz="0 1 0"/>'


def torque(links, joints):
    """Return the torque of gravity at the first hinge of a horizontal arm, whose second hinge is straight."""
    path = Path(tempfile.mkdtemp()) / "robot.urdf"
    text = "".join(LINK.format(*link) for link in links) + "".join(JOINT.format(*joint) for joint in joints)
    path.write_text(f'<robot name="r"><link name="base"/>{text}</robot>')
    parts, name, *_ = URDF_read(path)
    return abs(Robot(parts, name=name).gravload([np.pi / 2, 0.0])[0])


ends = ("base", "arm", "continuous", 0, AXIS)
one_link = torque([("arm", 1, 1), ("tool", 0.5, 1)], [ends, ("arm", "tool", "continuous", 1, AXIS)])
fixed = ("arm", "flange", "fixed", 1, "")
found = torque(
    [("arm", 0, 0), ("flange", 0, 1), ("tool", 0.5, 1)],
    [ends, fixed, ("flange", "tool", "continuous", 0, AXIS)],
)
right = (1.0 + 1.5) * G  # 1 kg at 1 m and 1 kg at 1.5 m
assert abs(one_link - right) < 1e-9
print(right - found)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "roboticstoolbox-python 1.5.0: stated 9.81, seen $seen N m of 24.5 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 9.81) <= 0.981)' "$seen" || {
    echo "This has changed."
    exit 1
}
