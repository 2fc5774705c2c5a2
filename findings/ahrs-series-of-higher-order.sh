#!/usr/bin/env bash
# Finding ahrs-series-of-higher-order: AHRS 0.4.0
#
# Does: AngularRate with method="series" has larger errors by higher orders: at 2 rad/s about z with a step of 0.01 s
#   it is off by 2.8e-5 by order 1, and by 1.9e-3 by the orders 2, 3 and 4.
# Right: an error that falls with the order, as the documentation says; order 4 leaves less than 1e-10.
# Cause: The powers of the matrix in the series are powers of its elements (S**i for arrays).
#
# Stated: 0.001888 off in the quaternion after 1 s
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
from ahrs.filters import AngularRate

RATE, STEPS, STEP = 2.0, 100, 0.01  # rad/s about z, and s
right = np.array([math.cos(RATE * STEPS * STEP / 2), 0.0, 0.0, math.sin(RATE * STEPS * STEP / 2)])


def error(order):
    """Return the error of the quaternion after 1 s at a constant rate, by the series of an order."""
    rates, start = np.tile([0.0, 0.0, RATE], (STEPS + 1, 1)), np.array([1.0, 0.0, 0.0, 0.0])
    made = AngularRate(gyr=rates, q0=start, Dt=STEP, method="series", order=order)
    return np.abs(np.asarray(made.Q[-1]) - right).max()


assert error(1) < 1e-4
print(error(4))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "AHRS 0.4.0: stated 0.001888, seen $seen off in the quaternion after 1 s"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.001888) <= 0.0001888)' "$seen" || {
    echo "This has changed."
    exit 1
}
