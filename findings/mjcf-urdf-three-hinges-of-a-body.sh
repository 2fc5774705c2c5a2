#!/usr/bin/env bash
# Finding mjcf-urdf-three-hinges-of-a-body: mjcf_urdf_simple_converter 0.7.3
#
# Does: The conversion of an MJCF body with three hinges through one point, 0.1 m from the body's frame, puts the
#   third hinge and the body 0.1 m off, without a message. With two hinges it is right.
# Right: the place of the body at the angles 0, which does not depend on its hinges.
# Cause: cumulative_pos adds up the positions of the hinges, each of which counts from the body's frame, so that from
#   the third hinge on the step between two hinges is wrong. A second fault: hinges without a range become revolute
#   joints with the limits 0 and 0.
#
# Stated: 0.1 m off
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q mjcf_urdf_simple_converter==0.7.3 numpy

cat > "$place/proof.py" <<'END'
import contextlib
import io
import tempfile
from pathlib import Path

import mujoco
from mjcf_urdf_simple_converter import convert

POINT = "0 0 0.1"  # of all hinges, in the body's frame


def height(hinges):
    """Return the height of a body at the angles 0, after the conversion of its hinges through one point."""
    joints = "".join(
        f'<joint name="{axis[::2]}" axis="{axis}" pos="{POINT}" range="-90 90"/>' for axis in hinges
    )
    body = f'<body name="body">{joints}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    path = Path(tempfile.mkdtemp()) / "robot.xml"
    path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    urdf = path.with_suffix(".urdf")
    convert(str(path), str(urdf))
    text = urdf.read_text().replace("<link", '<mujoco><compiler fusestatic="false"/></mujoco><link', 1)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.body("body").xpos[2]


axes = ["1 0 0", "0 1 0", "0 0 1"]
with contextlib.redirect_stdout(io.StringIO()):
    assert abs(height(axes[:2])) < 1e-12
    found = height(axes)
print(abs(found))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mjcf_urdf_simple_converter 0.7.3: stated 0.1, seen $seen m off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.1) <= 0.01)' "$seen" || {
    echo "This has changed."
    exit 1
}
