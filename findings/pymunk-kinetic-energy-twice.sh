#!/usr/bin/env bash
# Finding pymunk-kinetic-energy-twice: pymunk 7.3.1
#
# Does: Body.kinetic_energy is twice the kinetic energy: 62 J for 2 kg at 5 m/s with 3 kg m² at 2 rad/s.
# Right: m v²/2 + I ω²/2 = 31 J.
# Cause: Chipmunk's cpBodyKineticEnergy adds m v² and I ω² without the factor 1/2. Sums with the energy of gravity or
#   of springs are no constants of the motion.
#
# Stated: 31 J of 31 J too much
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
import pymunk

MASS, MOMENT, SPEED, RATE = 2.0, 3.0, 5.0, 2.0  # kg, kg m², m/s, rad/s
body = pymunk.Body(MASS, MOMENT)
body.velocity, body.angular_velocity = (3.0, 4.0), RATE
right = MASS * SPEED**2 / 2 + MOMENT * RATE**2 / 2
print(body.kinetic_energy - right)
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pymunk 7.3.1: stated 31, seen $seen J of 31 J too much"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 31.0) <= 3.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
