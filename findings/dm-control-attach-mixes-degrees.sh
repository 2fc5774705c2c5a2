#!/usr/bin/env bash
# Finding dm-control-attach-mixes-degrees: dm_control 1.0.50
#
# Does: attach changes the meaning of angles: a model whose angles are in degrees by MJCF's default, attached to one
#   with <compiler angle="radian"/>, has its limits of ±60° read as ±60 rad, without a message. Two models that both
#   name their unit are refused.
# Right: π/3 rad, which the attached model has by itself.
# Cause: <compiler> is shared by the joined model, and the attributes of both models are joined where only one of them
#   has a value. An eulerseq or inertiafromgeom of the attached model likewise turns the other model's bodies, or
#   changes their masses.
#
# Stated: 58.953 rad too wide, of 1.05
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q dm_control==1.0.50 numpy

cat > "$place/proof.py" <<'END'
import math

import mujoco
from dm_control import mjcf

ARM = """<mujoco model="{0}">{1}<worldbody><body name="{0}"><joint name="hinge" type="hinge" limited="true"
range="-{2} {2}"/><geom size="0.1"/><site name="end"/></body></worldbody></mujoco>"""


def limits(model):
    """Return the upper limits (rad) of the hinges of a model."""
    return mujoco.MjModel.from_xml_string(model.to_xml_string()).jnt_range[:, 1]


arm = mjcf.from_xml_string(ARM.format("arm", '<compiler angle="radian"/>', 1))
tool = mjcf.from_xml_string(ARM.format("tool", "", 60))
right = math.radians(60.0)
assert abs(limits(tool)[0] - right) < 1e-12
arm.find("site", "end").attach(tool)
print(limits(arm)[1] - right)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "dm_control 1.0.50: stated 58.953, seen $seen rad too wide, of 1.05"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 58.953) <= 5.8953)' "$seen" || {
    echo "This has changed."
    exit 1
}
