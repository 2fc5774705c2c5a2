#!/usr/bin/env bash
# Finding ahrs-average-squares-weights: AHRS 0.4.0
#
# Does: QuaternionArray.average squares the weights: of two rotations about z by 0 and 2 rad with the weights 0.8 and
#   0.2 the average is 0.058 rad.
# Right: 0.249 rad: the documentation defines the average by M = Σ w q qᵀ, whose largest eigenvector is at the angle 2
#   x with tan 2x = 0.2 sin 2 / (0.8 + 0.2 cos 2).
# Cause: Quaternions are multiplied by their weights, and then q qᵀ is summed, which has the weights twice.
#
# Stated: 0.1902 rad of 0.249 off
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q AHRS==0.4.0 numpy

cat > "$place/proof.py" <<'END'
import math

import numpy as np
from ahrs import QuaternionArray

ANGLE, FIRST, SECOND = 2.0, 0.8, 0.2  # rad between two rotations about z, and their weights
half = ANGLE / 2
pair = QuaternionArray([[1.0, 0.0, 0.0, 0.0], [math.cos(half), 0.0, 0.0, math.sin(half)]])
# The maximum of q' M q in the plane of both has tan(2 x) = w2 sin(2 half) / (w1 + w2 cos(2 half)).
right = math.atan2(SECOND * math.sin(ANGLE), FIRST + SECOND * math.cos(ANGLE))
equal, weighted = pair.average(), pair.average(weights=np.array([FIRST, SECOND]))
assert abs(abs(2 * math.atan(equal[3] / equal[0])) - ANGLE / 2) < 1e-12
print(right - abs(2 * math.atan(weighted[3] / weighted[0])))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "AHRS 0.4.0: stated 0.1902, seen $seen rad of 0.249 off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.1902) <= 0.01902)' "$seen" || {
    echo "This has changed."
    exit 1
}
