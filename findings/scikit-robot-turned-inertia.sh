#!/usr/bin/env bash
# Finding scikit-robot-turned-inertia: scikit-robot 0.4.7
#
# Does: torque_vector and inverse_dynamics ignore the rpy of <inertial><origin> in a URDF: moments of 0.1, 0.2 and 0.3
#   kg m² in a frame that is turned by 90° about x give 0.3 N m about z at 1 rad/s².
# Right: 0.2 N m, since the inertial frame's y axis lies along z.
# Cause: The reader takes the position of the inertial frame and the tensor, and not its orientation.
#
# Stated: 0.1 N m of 0.2 too much
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
import math

import numpy as np
from skrobot.models.urdf import RobotModelFromURDF

MOMENTS = (0.1, 0.2, 0.3)  # kg m², along the axes of the inertial frame
LINK = """<link name="{0}"><inertial><origin rpy="{1} 0 0"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>"""


def torque(roll):
    """Return the torque of the hinge about z at 1 rad/s², for an inertial frame that is turned about x."""
    urdf = f'<robot name="r">{LINK.format("base", 0)}{LINK.format("arm", roll)}{JOINT}</robot>'
    step, motion = 1e-3, [np.array([time**2 / 2]) for time in (-1e-3, 0.0, 1e-3)]
    names = dict(zip(("av_prev", "av", "av_next"), motion, strict=True))
    return RobotModelFromURDF(urdf=urdf).torque_vector(calc_statics_p=False, dt=step, **names)[0]


assert abs(torque(0.0) - MOMENTS[2]) < 1e-6
print(torque(math.pi / 2) - MOMENTS[1])
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "scikit-robot 0.4.7: stated 0.1, seen $seen N m of 0.2 too much"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.1) <= 0.01)' "$seen" || {
    echo "This has changed."
    exit 1
}
