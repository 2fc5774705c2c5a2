#!/usr/bin/env bash
# Finding scikit-robot-moment-on-slide: scikit-robot 0.4.7
#
# Does: torque_vector gives a sliding joint a force that balances an external moment: 1 N for 1 N m about the axis of
#   the slide.
# Right: 0: a moment does no work on a translation.
# Cause: Moments are multiplied by the axis of each joint between load and base, also of prismatic ones. A second
#   fault: moments count in the axes of the link, and forces in the world's axes.
#
# Stated: 1 N too much
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q scikit-robot==0.4.7 numpy

cat > "$place/proof.py" <<'END'
import numpy as np
from skrobot.models.urdf import RobotModelFromURDF

INERTIA = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
JOINT = """<joint name="of cart" type="{0}"><parent link="base"/><child link="cart"/><axis xyz="0 0 1"/>
<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>"""


def effort(kind):
    """Return the effort of a joint along or about z that holds a moment of 1 N m about z, without gravity."""
    links = "".join(f'<link name="{name}">{INERTIA}</link>' for name in ("base", "cart"))
    robot = RobotModelFromURDF(urdf=f'<robot name="r">{links}{JOINT.format(kind)}</robot>')
    load = {
        "force_list": [np.zeros(3)],
        "moment_list": [np.array([0.0, 0.0, 1.0])],
        "target_coords": [robot.cart],
    }
    return abs(robot.torque_vector(**load, gravity=np.zeros(3))[0])


assert abs(effort("revolute") - 1.0) < 1e-9
print(effort("prismatic"))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "scikit-robot 0.4.7: stated 1, seen $seen N too much"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.0) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
