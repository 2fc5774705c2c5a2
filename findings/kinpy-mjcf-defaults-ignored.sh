#!/usr/bin/env bash
# Finding kinpy-mjcf-defaults-ignored: kinpy 0.6.1
#
# Does: build_chain_from_mjcf ignores <default>, and says nothing: a hinge whose axis is y by default turns about z.
# Right: the place by the same axis in the joint itself.
# Cause: The reader takes attributes of the joint alone, and z where it has no axis.
#
# Stated: 0.67801 m off, of 1 m
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
import math

import kinpy
import numpy as np

MODEL = """<mujoco>{}<worldbody><body name="arm"><joint name="hinge" type="hinge" {}/>
<geom type="sphere" size="0.1"/><body name="tip" pos="1 0 0"><geom type="sphere" size="0.1"/></body></body>
</worldbody></mujoco>"""
ANGLE = 0.5  # rad


def tip(*parts):
    """Return the place of a point 1 m along x of the arm."""
    return kinpy.build_chain_from_mjcf(MODEL.format(*parts)).forward_kinematics({"hinge": ANGLE})["tip"].pos


right = np.array([math.cos(ANGLE), 0.0, -math.sin(ANGLE)])
assert np.abs(tip("", 'axis="0 1 0"') - right).max() < 1e-9
print(np.linalg.norm(tip('<default><joint axis="0 1 0"/></default>', "") - right))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "kinpy 0.6.1: stated 0.67801, seen $seen m off, of 1 m"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.67801) <= 0.067801)' "$seen" || {
    echo "This has changed."
    exit 1
}
