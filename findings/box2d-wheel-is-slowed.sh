#!/usr/bin/env bash
# Finding box2d-wheel-is-slowed: Box2D 2.3.10
#
# Does: A step slows a free wheel of 200 rad/s to 94.2 rad/s, and says nothing. Bodies faster than 120 m/s are slowed
#   likewise at a step of 1/60 s.
# Right: 200 rad/s: nothing acts on the wheel, and its damping is 0.
# Cause: A step turns a body by at most π/2 and moves it by at most 2 m (b2_maxRotation, b2_maxTranslation); faster
#   bodies get the velocity that fits. The limit falls with a longer step.
#
# Stated: 105.752 rad/s of 200 lost in the first step
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q Box2D==2.3.10 numpy

cat > "$place/proof.py" <<'END'
import Box2D

RATE, STEP = 200.0, 1 / 60  # rad/s, s
world = Box2D.b2World(gravity=(0, 0))
wheel = world.CreateDynamicBody(position=(0, 0))
wheel.CreateCircleFixture(radius=0.5, density=1.0)
wheel.angularDamping, wheel.angularVelocity = 0.0, RATE
world.Step(STEP, 8, 3)
print(RATE - wheel.angularVelocity)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "Box2D 2.3.10: stated 105.752, seen $seen rad/s of 200 lost in the first step"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 105.752) <= 10.5752)' "$seen" || {
    echo "This has changed."
    exit 1
}
