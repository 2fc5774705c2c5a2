#!/usr/bin/env bash
# Finding placo-relative-position-task: placo 0.10.2
#
# Does: DynamicsSolver.add_relative_position_task, by which placo closes loops, gives wrong accelerations of a closure
#   that moves: a pin on a crank of 0.5 m that turns at 3 rad/s gets none at all. Position and velocity of the closure
#   are met, and the solver reports success.
# Right: the centripetal acceleration of a point on a circle, 4.5 m/s² towards the centre. The matrix of the task is
#   right, and so are matrix and right-hand side of the tasks for positions, orientations, the centre of mass and
#   gears, by differences.
# Cause: relative_position_task.cpp has two faults. It adds the term ω × (ω × r) twice. It takes the rotation rows
#   (block(3, 0)) of the Jacobian's derivative, where the translation rows are right. Both faults vanish at rest.
#
# Stated: 4.5 m/s² of 4.5 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q placo==0.10.2 numpy

cat > "$place/proof.py" <<'END'
import tempfile
from pathlib import Path

import numpy as np
import placo

SPEED, LENGTH = 3.0, 0.5  # rad/s, m
INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
LINK = f'<link name="{{}}"><inertial><mass value="1"/>{INERTIA}</inertial></link>'
ENDS = '<parent link="{}"/><child link="{}"/><axis xyz="{}"/>'
JOINT = (
    f'<joint name="{{}}" type="{{}}">{ENDS}<limit lower="-9" upper="9" effort="99" velocity="99"/></joint>'
)
JOINTS = (
    ("turn", "revolute", "base", "crank", "0 0 1"),
    ("x", "prismatic", "base", "slide", "1 0 0"),
    ("y", "prismatic", "slide", "pin", "0 1 0"),
)
links = "".join(map(LINK.format, ("base", "crank", "slide", "pin")))
path = Path(tempfile.mkdtemp()) / "robot.urdf"
path.write_text(f'<robot name="r">{links}{"".join(JOINT.format(*joint) for joint in JOINTS)}</robot>')
robot = placo.RobotWrapper(str(path), placo.Flags.ignore_collisions)
robot.set_joint("x", LENGTH)
robot.set_joint_velocity("turn", SPEED)
robot.set_joint_velocity("y", SPEED * LENGTH)
robot.update_kinematics()
solver = placo.DynamicsSolver(robot)
solver.mask_fbase(True)
loop = solver.add_relative_position_task("crank", "pin", np.array([LENGTH, 0.0, 0.0]))  # the pin on the crank
loop.mask.set_axises("xy")
loop.configure("loop", "hard", 1.0)
steady = solver.add_joints_task()
steady.set_joint("turn", 0.0, SPEED, 0.0)  # the crank turns at a constant speed
steady.configure("steady", "hard", 1.0)
result = solver.solve(False)
assert result.success and max(np.abs(loop.error).max(), np.abs(loop.derror).max()) < 1e-12
print(result.qdd[robot.get_joint_v_offset("x")] + SPEED**2 * LENGTH)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "placo 0.10.2: stated 4.5, seen $seen m/s² of 4.5 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 4.5) <= 0.45)' "$seen" || {
    echo "This has changed."
    exit 1
}
