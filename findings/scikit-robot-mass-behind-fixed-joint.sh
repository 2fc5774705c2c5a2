#!/usr/bin/env bash
# Finding scikit-robot-mass-behind-fixed-joint: scikit-robot 0.4.7
#
# Does: torque_vector of a motion (calc_statics_p=False) leaves out masses behind fixed joints: 2 kg that a fixed
#   joint holds 1.5 m from a hinge need no torque at 1 rad/s².
# Right: m r² = 4.5 N m. The documentation of include_all_mass_links (True by default) says that all links with mass
#   are included.
# Cause: The recursion of Newton and Euler runs over links with moving joints; only the statics count all links.
#
# Stated: 4.5 N m of 4.5 lost
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

LINK = """<link name="{0}"><inertial><mass value="{1}"/>
<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="of {1}" type="{2}"><parent link="{0}"/><child link="{1}"/><origin xyz="{3} 0 0"/>
<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="9" velocity="9"/></joint>"""
links = "".join(LINK.format(*link) for link in (("base", 1), ("arm", 0), ("tool", 2)))
joints = JOINT.format("base", "arm", "revolute", 0) + JOINT.format("arm", "tool", "fixed", 1.5)
robot = RobotModelFromURDF(urdf=f'<robot name="r">{links}{joints}</robot>')
motion = [np.array([time**2 / 2]) for time in (-1e-3, 0.0, 1e-3)]
names = dict(zip(("av_prev", "av", "av_next"), motion, strict=True))
right = 2 * 1.5**2  # N m: 2 kg at 1.5 m from the hinge, at 1 rad/s²
print(right - robot.torque_vector(calc_statics_p=False, dt=1e-3, **names)[0])
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "scikit-robot 0.4.7: stated 4.5, seen $seen N m of 4.5 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 4.5) <= 0.45)' "$seen" || {
    echo "This has changed."
    exit 1
}
