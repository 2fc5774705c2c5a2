#!/usr/bin/env bash
# Finding yourdfpy-mimic-not-written: yourdfpy 0.0.60
#
# Does: write_xml_file leaves out the <mimic> of joints, and says nothing: the follower of a robot that is read and
#   written is a joint of its own, and does not move with the leader.
# Right: 2 · 0.5 rad for a follower with the multiplier 2, as in the file that was read; update_cfg moves the follower
#   by <mimic> there.
# Cause: _write_joint writes origin, axis, limit and dynamics. _write_mimic exists and is not called, and neither are
#   the functions for <calibration> and <safety_controller>. Known as issue 57 of clemense/yourdfpy (open since March
#   2025).
#
# Stated: 1 rad of 1 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q yourdfpy==0.0.60 numpy

cat > "$place/proof.py" <<'END'
import logging
import tempfile
from pathlib import Path

import numpy as np
import yourdfpy

logging.disable()
LINKS = "".join(f'<link name="{name}"/>' for name in ("base", "leader", "follower"))
JOINT = '<joint name="{0}" type="continuous"><parent link="base"/><child link="{0}"/><axis xyz="0 0 1"/>{1}</joint>'
MIMIC = '<mimic joint="leader" multiplier="2"/>'
ANGLE = 0.5  # rad, of the leader


def angle(path):
    """Return the angle of the follower of a file."""
    robot = yourdfpy.URDF.load(path, load_meshes=False)
    robot.update_cfg({"leader": ANGLE})
    turn = robot.get_transform("follower", "base")
    return np.arctan2(turn[1, 0], turn[0, 0])


read, written = (Path(tempfile.mkdtemp()) / "robot.urdf" for _ in range(2))
read.write_text(
    f'<robot name="r">{LINKS}{JOINT.format("leader", "")}{JOINT.format("follower", MIMIC)}</robot>'
)
yourdfpy.URDF.load(str(read), load_meshes=False).write_xml_file(str(written))
assert abs(angle(str(read)) - 2 * ANGLE) < 1e-12
print(2 * ANGLE - angle(str(written)))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "yourdfpy 0.0.60: stated 1, seen $seen rad of 1 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.0) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
