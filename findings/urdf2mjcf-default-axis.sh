#!/usr/bin/env bash
# Finding urdf2mjcf-default-axis: urdf2mjcf 0.2.39
#
# Does: A joint without <axis> turns about z after the conversion of a URDF to MJCF, and no message says so.
# Right: the x axis: the URDF specification defines (1, 0, 0) as the default of <axis>.
# Cause: The converter writes no axis if the URDF has none, and the default of MJCF is z. kinpy 0.6.1 and pytorch-
#   kinematics 0.10.0 take z for such joints, too; yourdfpy, urchin, ikpy, Pinocchio and MuJoCo's reader of URDF take
#   x.
#
# Stated: 1.5708 rad between the axes
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q urdf2mjcf==0.2.39 numpy

cat > "$place/proof.py" <<'END'
import logging
import tempfile
from pathlib import Path

import mujoco
import numpy as np
from urdf2mjcf.convert import convert_urdf_to_mjcf
from urdf2mjcf.model import ConversionMetadata

logging.disable()
INERTIA = '<inertial><origin xyz="0 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
SHAPE = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'
LINK = f'<link name="{{}}">{INERTIA}{SHAPE}</link>'
HINGE = '<joint name="h" type="continuous"><parent link="a"/><child link="b"/>{}</joint>'


def axis(element):
    """Return the axis of a hinge after the conversion."""
    path = Path(tempfile.mkdtemp()) / "robot.urdf"
    path.write_text(f'<robot name="r">{LINK.format("a")}{LINK.format("b")}{HINGE.format(element)}</robot>')
    file = path.with_suffix(".xml")
    convert_urdf_to_mjcf(path, file, metadata=ConversionMetadata(floating_base=False))
    return mujoco.MjModel.from_xml_path(str(file)).joint("h").axis


x = np.array([1.0, 0.0, 0.0])
assert np.abs(axis('<axis xyz="1 0 0"/>') - x).max() < 1e-12
print(np.arccos(axis("") @ x))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "urdf2mjcf 0.2.39: stated 1.5708, seen $seen rad between the axes"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.5708) <= 0.15708)' "$seen" || {
    echo "This has changed."
    exit 1
}
