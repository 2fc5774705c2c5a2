#!/usr/bin/env bash
# Finding kinpy-mjcf-orientation-ignored: kinpy 0.6.1
#
# Does: build_chain_from_mjcf ignores the orientation of a body that is given as euler, axisangle, xyaxes or zaxis,
#   and says nothing: an arm that is turned by 90° about x lies in y.
# Right: the place by the same orientation as quat, which kinpy reads.
# Cause: The reader takes pos and quat of a body alone.
#
# Stated: 1.41421 m off, of 1 m
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q kinpy==0.6.1 numpy

cat > "$place/proof.py" <<'END'
import kinpy
import numpy as np

BODIES = """<mujoco><compiler angle="radian"/><worldbody><body name="arm" {}>
<joint name="hinge" type="hinge" axis="0 0 1"/><geom type="sphere" size="0.1"/>
<body name="tip" pos="0 1 0"><geom type="sphere" size="0.1"/></body></body></worldbody></mujoco>"""


def tip(orientation):
    """Return the place of a point 1 m along y of an arm with an orientation, at the angle 0."""
    chain = kinpy.build_chain_from_mjcf(BODIES.format(orientation))
    return chain.forward_kinematics({"hinge": 0.0})["tip"].pos


right = np.array([0.0, 0.0, 1.0])
assert np.abs(tip('quat="0.7071067811865476 0.7071067811865476 0 0"') - right).max() < 1e-9
print(np.linalg.norm(tip('euler="1.5707963267948966 0 0"') - right))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "kinpy 0.6.1: stated 1.41421, seen $seen m off, of 1 m"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.41421) <= 0.141421)' "$seen" || {
    echo "This has changed."
    exit 1
}
