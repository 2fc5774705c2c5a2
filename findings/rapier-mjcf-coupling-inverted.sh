#!/usr/bin/env bash
# Finding rapier-mjcf-coupling-inverted: rapier3d 0.36.1
#
# Does: The loader of MJCF inverts a <joint> equality: with joint1, joint2 and polycoef="0 3 0 0 0" the second joint
#   turns three times as fast as the first one. The loader with impulse joints drops the equality without a message.
# Right: joint1 = 3 joint2, by MuJoCo's XML reference: the polynomial of the second joint's coordinate gives the first
#   one's. MuJoCo has a ratio of 3.
# Cause: The constraint is made as q2 = c q1; the loader's own test, tests/equality_joint.rs, expects that. A ratio of
#   1 or -1 hides it. Exchange the joints, or invert the coefficient.
#
# Stated: 2.6667 off in the ratio of 3
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q rapier3d==0.36.1 numpy

cat > "$place/proof.py" <<'END'
from rapier3d import PhysicsWorld
from rapier3d.loaders import mjcf

RATIO = 3.0
BODY = '<body name="{0}" pos="{1} 0 0"><joint name="of {0}" axis="0 1 0"/>{2}</body>'
INERTIA = '<inertial pos="0.1 0 0" mass="1" diaginertia="1 1 1"/>'
bodies = "".join(BODY.format(name, x, INERTIA) for name, x in (("first", 0), ("second", 1)))
COUPLING = f'<joint joint1="of first" joint2="of second" polycoef="0 {RATIO} 0 0 0"/>'
MODEL = f"<mujoco><worldbody>{bodies}</worldbody><equality>{COUPLING}</equality></mujoco>"
world = PhysicsWorld(gravity=(0.0, 0.0, -9.81))
robot, _ = mjcf.MjcfRobot.from_str(MODEL)
handles = robot.insert_using_multibody_joints(
    world.rigid_bodies, world.colliders, world.multibody_joints, world.impulse_joints
)
for _ in range(10):
    world.step()
of = {name: handles.bodies[k].body for name, k in handles.body_name_to_idx.items() if name != "world"}
first, second = (world.rigid_bodies[of[name]].angvel.y for name in ("first", "second"))
assert abs(first) > 0.01
print(abs(first / second - RATIO))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "rapier3d 0.36.1: stated 2.6667, seen $seen off in the ratio of 3"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 2.6667) <= 0.26667)' "$seen" || {
    echo "This has changed."
    exit 1
}
