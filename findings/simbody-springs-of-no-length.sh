#!/usr/bin/env bash
# Finding simbody-springs-of-no-length: opensim 4.6
#
# Does: PointToPointSpring of rest length 0, and ExpressionBasedPointToPointForce of 3 d, make every acceleration of a
#   body NaN where their two points meet. At a distance of 1e-9 m they are right. No error is raised.
# Right: The force stiffness times the vector between the points is 0 there, so that the body falls with gravity.
#   Exudyn's and MuJoCo's springs do so.
# Cause: Not read in the source: NaN is what a vector over its length of 0 gives. Begin with points that are apart by
#   1e-9 m.
#
# Stated: 6 accelerations of six are not finite
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q opensim==4.6 numpy

cat > "$place/proof.py" <<'END'
import math

import opensim

opensim.Logger.setLevelString("Off")
ORIGIN, STIFFNESS = opensim.Vec3(0), 3.0


def spring(ground, body):
    """Return a spring from the origin of the ground to the body's centre of mass."""
    return opensim.PointToPointSpring(ground, ORIGIN, body, ORIGIN, STIFFNESS, 0.0)


def accelerations(apart):
    """Return the accelerations (6,) of a free body at a distance (m) from the origin, along y."""
    model = opensim.Model()
    model.setGravity(opensim.Vec3(0, -9.81, 0))
    body = opensim.Body("body", 2.0, ORIGIN, opensim.Inertia(1, 1, 1))
    model.addBody(body)
    joint = opensim.FreeJoint("joint", model.getGround(), body)
    model.addJoint(joint)
    model.addForce(spring(model.getGround(), body))
    state = model.initSystem()
    joint.upd_coordinates(4).setValue(state, apart)
    model.realizeAcceleration(state)
    return [joint.get_coordinates(k).getAccelerationValue(state) for k in range(6)]


assert abs(accelerations(1e-9)[4] + 9.81) < 1e-6
print(sum(not math.isfinite(a) for a in accelerations(0.0)))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "opensim 4.6: stated 6, seen $seen accelerations of six are not finite"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 6.0) <= 0.6)' "$seen" || {
    echo "This has changed."
    exit 1
}
