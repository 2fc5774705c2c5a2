#!/usr/bin/env bash
# Finding rapier-mjcf-closures-of-sites: rapier3d 0.36.1
#
# Does: The loader of MJCF drops <connect> and <weld> between two sites, and says nothing: loops stay open. It does so
#   with impulse joints and with multibody joints.
# Right: two closures. MuJoCo's XML reference defines both elements by two bodies or by two sites (site1, site2); the
#   loader makes both of bodies.
# Cause: The loader resolves body1 and body2 alone. Its README lists both elements as supported. Give the closures as
#   bodies with an anchor or a relpose.
#
# Stated: 2 closures of 2 missing
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

BODY = '<body name="{0}"><joint axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><site name="at {0}"/></body>'


def closures(equality):
    """Return the number of closures that the loader makes of an equality of two bodies."""
    bodies = BODY.format("a") + BODY.format("b")
    text = f"<mujoco><worldbody>{bodies}</worldbody><equality>{equality}</equality></mujoco>"
    world, (robot, _) = PhysicsWorld(), mjcf.MjcfRobot.from_str(text)
    sets = world.rigid_bodies, world.colliders, world.multibody_joints, world.impulse_joints
    return len(robot.insert_using_multibody_joints(*sets).equality_joints)


for kind, more in (("connect", 'anchor="0 0 0"'), ("weld", "")):
    assert closures(f'<{kind} body1="a" body2="b" {more}/>') == 1
print(sum(1 - closures(f'<{kind} site1="at a" site2="at b"/>') for kind in ("connect", "weld")))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "rapier3d 0.36.1: stated 2, seen $seen closures of 2 missing"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 2) <= 0.2)' "$seen" || {
    echo "This has changed."
    exit 1
}
