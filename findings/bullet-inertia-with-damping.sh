#!/usr/bin/env bash
# Finding bullet-inertia-with-damping: pybullet 3.2.7
#
# Does: changeDynamics drops an inertia that is set together with damping, without a word.
# Right: the inertia that was set, as when it is set alone.
# Cause: The moments stay zero, and the run converges to the motion of another body.
#
# Stated: 0.1 kg m² of 0.1 lost
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

p.connect(p.DIRECT)
still = [0, 0, 0, 1]
body = p.createMultiBody(
    baseMass=0,
    linkMasses=[1.0],
    linkCollisionShapeIndices=[-1],
    linkVisualShapeIndices=[-1],
    linkPositions=[[0, 0, 0]],
    linkOrientations=[still],
    linkInertialFramePositions=[[0.3, 0, 0]],
    linkInertialFrameOrientations=[still],
    linkParentIndices=[0],
    linkJointTypes=[p.JOINT_REVOLUTE],
    linkJointAxis=[[0, 0, 1]],
)
p.changeDynamics(body, 0, localInertiaDiagonal=[0.1, 0.1, 0.1], linearDamping=0, angularDamping=0)
print(0.1 - p.getDynamicsInfo(body, 0)[2][0])
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pybullet 3.2.7: stated 0.1, seen $seen kg m² of 0.1 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.1) <= 0.01)' "$seen" || {
    echo "This has changed."
    exit 1
}
