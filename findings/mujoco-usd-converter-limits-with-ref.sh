#!/usr/bin/env bash
# Finding mujoco-usd-converter-limits-with-ref: mujoco-usd-converter 0.8.0
#
# Does: A hinge with ref keeps its range in USD: with ref="30" and the range from -60° to 90° the upper limit of the
#   PhysicsRevoluteJoint is 90°, though the joint's frames coincide in the pose of 30°.
# Right: 60°: limits of UsdPhysics count from where both frames of the joint coincide, and MJCF's range from 30°
#   before that.
# Cause: The range is written as it is; ref is kept only in mjc:ref, which belongs to no schema of UsdPhysics.
#
# Stated: 30 degrees too far
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q mujoco-usd-converter==0.8.0 numpy

cat > "$place/proof.py" <<'END'
import tempfile
from pathlib import Path

import mujoco_usd_converter
from pxr import Usd, UsdPhysics

MODEL = """<mujoco model="m"><compiler angle="degree"/><worldbody><body name="arm">
<joint name="hinge" type="hinge" axis="0 0 1" ref="{0}" limited="true" range="-60 90"/><geom size="0.1"/>
</body></worldbody></mujoco>"""


def upper(ref):
    """Return the upper limit (degrees) of the hinge in USD; its joint frames coincide in the written pose."""
    folder = Path(tempfile.mkdtemp())
    (folder / "m.xml").write_text(MODEL.format(ref))
    made = mujoco_usd_converter.Converter().convert(str(folder / "m.xml"), str(folder / "made"))
    stage = Usd.Stage.Open(str(made.path))
    [joint] = [each for each in stage.Traverse() if each.IsA(UsdPhysics.RevoluteJoint)]
    hinge = UsdPhysics.RevoluteJoint(joint)
    assert hinge.GetLocalRot0Attr().Get() == hinge.GetLocalRot1Attr().Get()  # the body is not turned
    return hinge.GetUpperLimitAttr().Get()


assert abs(upper(0) - 90) < 1e-3
print(upper(30) - (90 - 30))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mujoco-usd-converter 0.8.0: stated 30, seen $seen degrees too far"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 30.0) <= 3)' "$seen" || {
    echo "This has changed."
    exit 1
}
