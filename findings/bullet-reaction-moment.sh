#!/usr/bin/env bash
# Finding bullet-reaction-moment: pybullet 3.2.7
#
# Does: The moment of a joint's force and torque sensor counts about the centre of mass of the link behind the joint:
#   a beam of 1 kg, held by a fixed joint 1 m from its centre of mass, shows the moment 0.
# Right: m g l = 9.81 N m about the joint, as with
#   setPhysicsEngineParameter(jointFeedbackMode=JOINT_FEEDBACK_IN_JOINT_FRAME).
# Cause: The feedback is the spatial force of the recursion, whose frame is at the link's centre of mass.
#   JOINT_FEEDBACK_IN_WORLD_SPACE turns it into the world's axes and leaves the point.
#
# Stated: 9.81 N m of 9.81 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q pybullet==3.2.7 numpy

cat > "$place/proof.py" <<'END'
import pybullet as p

WEIGHT, ARM = 9.81, 1.0  # N, and m from the joint to the centre of mass
p.connect(p.DIRECT)
p.setGravity(0, 0, -WEIGHT)
still = [0, 0, 0, 1]
beam = p.createMultiBody(
    baseMass=0,
    linkMasses=[1.0],
    linkCollisionShapeIndices=[-1],
    linkVisualShapeIndices=[-1],
    linkPositions=[[0, 0, 0]],
    linkOrientations=[still],
    linkInertialFramePositions=[[ARM, 0, 0]],
    linkInertialFrameOrientations=[still],
    linkParentIndices=[0],
    linkJointTypes=[p.JOINT_FIXED],
    linkJointAxis=[[0, 0, 1]],
)
p.enableJointForceTorqueSensor(beam, 0, True)


def reaction(mode):
    """Return force and moment of the fixed joint after a step."""
    p.setPhysicsEngineParameter(**mode)
    p.stepSimulation()
    return p.getJointState(beam, 0)[2]


found = reaction({})
assert abs(found[2] - WEIGHT) < 1e-9
assert abs(abs(reaction({"jointFeedbackMode": p.JOINT_FEEDBACK_IN_JOINT_FRAME})[4]) - WEIGHT * ARM) < 1e-9
print(WEIGHT * ARM - abs(found[4]))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pybullet 3.2.7: stated 9.81, seen $seen N m of 9.81 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 9.81) <= 0.981)' "$seen" || {
    echo "This has changed."
    exit 1
}
