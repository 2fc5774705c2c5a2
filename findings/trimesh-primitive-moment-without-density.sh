#!/usr/bin/env bash
# Finding trimesh-primitive-moment-without-density: trimesh 5.2.0
#
# Does: moment_inertia of the primitives Cylinder and Sphere ignores density, and mass does not: a cylinder of 1000
#   kg/m³ has the moment of inertia of 1 kg/m³.
# Right: mass times r²/2 about the axis, as the primitive Box has its moments.
# Cause: Both classes replace the moment of inertia of the mesh by a formula with the volume in place of the mass.
#
# Stated: 0.999 of the moment of inertia lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q trimesh==5.2.0 numpy

cat > "$place/proof.py" <<'END'
import math

from trimesh.primitives import Box, Cylinder

DENSITY, RADIUS, HEIGHT = 1000.0, 0.5, 2.0  # kg/m³, m, m
box, cylinder = Box(extents=[1.0, 2.0, 3.0]), Cylinder(radius=RADIUS, height=HEIGHT)
box.density = cylinder.density = DENSITY
assert abs(box.moment_inertia[2, 2] - DENSITY * 6 * (1 + 4) / 12) < 1e-6
right = DENSITY * math.pi * RADIUS**2 * HEIGHT * RADIUS**2 / 2
assert abs(cylinder.mass * RADIUS**2 / 2 - right) < 0.01 * right
print((right - cylinder.moment_inertia[2, 2]) / right)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "trimesh 5.2.0: stated 0.999, seen $seen of the moment of inertia lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.999) <= 0.0999)' "$seen" || {
    echo "This has changed."
    exit 1
}
