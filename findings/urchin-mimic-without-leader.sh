#!/usr/bin/env bash
# Finding urchin-mimic-without-leader: urchin 0.0.30
#
# Does: link_fk ignores the <mimic> of a joint whose leader has no value in the configuration: with the default
#   configuration a follower with an offset of 0.3 rad is at 0. So is a follower whose leader follows another joint,
#   at every configuration.
# Right: the offset, since the leader is at 0 there by the documentation of link_fk; with {leader: 0} urchin itself
#   gives it.
# Cause: link_fk computes the follower only if its leader is a key of the configuration, and otherwise takes no
#   coordinate, instead of the leader's default; followers are no keys.
#
# Stated: 0.3 rad of 0.3 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q urchin==0.0.30 numpy

cat > "$place/proof.py" <<'END'
import tempfile
from pathlib import Path

import numpy as np
import urchin

LINK = '<link name="{}"/>'
JOINT = '<joint name="{0}" type="continuous"><parent link="base"/><child link="{0}"/><axis xyz="0 0 1"/>{1}</joint>'
MIMIC = '<mimic joint="leader" multiplier="2" offset="0.3"/>'
links = "".join(map(LINK.format, ("base", "leader", "follower")))
path = Path(tempfile.mkdtemp()) / "robot.urdf"
path.write_text(
    f'<robot name="r">{links}{JOINT.format("leader", "")}{JOINT.format("follower", MIMIC)}</robot>'
)
robot = urchin.URDF.load(str(path))


def angle(configuration):
    """Return the angle of the follower in a configuration."""
    turn = robot.link_fk(cfg=configuration, link="follower")
    return np.arctan2(turn[1, 0], turn[0, 0])


assert abs(angle({"leader": 0.0}) - 0.3) < 1e-12
print(0.3 - angle(None))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "urchin 0.0.30: stated 0.3, seen $seen rad of 0.3 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.3) <= 0.03)' "$seen" || {
    echo "This has changed."
    exit 1
}
