#!/usr/bin/env bash
# Finding pymunk-moment-of-rounded-shape: pymunk 7.3.1
#
# Does: The moment of inertia that a polygon with a radius gives to its body leaves out the rounded rim, and its mass
#   does not: a square of 2 m with a rim of 0.5 m has 8.79 kg and 5.86 kg m² at 1 kg/m².
# Right: 12.67 kg m²: the square 8/3, four strips 7.67, and four quarters of a disc 2.34.
# Cause: The mass follows from the area with the rim, and the moment is this mass times the moment of the bare polygon
#   for a mass of 1. moment_for_poly ignores its radius, and moment_for_segment takes a rectangle for the rounded
#   segment: with both ends in one point it gives 2/3 m r², and a disc has 1/2 m r².
#
# Stated: 6.812 kg m² of 12.7 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q pymunk==7.3.1 numpy

cat > "$place/proof.py" <<'END'
import math

import pymunk

HALF, RADIUS = 1.0, 0.5  # m: half the side of a square, and the radius of its rounding
body = pymunk.Body()
shape = pymunk.Poly(body, [(-HALF, -HALF), (HALF, -HALF), (HALF, HALF), (-HALF, HALF)], radius=RADIUS)
shape.density = 1.0
square = 4 * HALF**2 * 2 * HALF**2 / 3
strip = 2 * HALF * RADIUS
strips = 4 * strip * ((4 * HALF**2 + RADIUS**2) / 12 + (HALF + RADIUS / 2) ** 2)
corners = math.pi * RADIUS**2 * 2 * HALF**2 + math.pi * RADIUS**4 / 2 + 16 * HALF * RADIUS**3 / 3
assert abs(shape.mass - (4 * HALF**2 + 4 * strip + math.pi * RADIUS**2)) < 1e-12
print(square + strips + corners - shape.moment)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pymunk 7.3.1: stated 6.812, seen $seen kg m² of 12.7 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 6.812) <= 0.6812)' "$seen" || {
    echo "This has changed."
    exit 1
}
