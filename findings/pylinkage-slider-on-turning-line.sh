#!/usr/bin/env bash
# Finding pylinkage-slider-on-turning-line: pylinkage 1.3.0
#
# Does: step_with_derivatives gives a wrong acceleration of a slider (RRPDyad) on a line that turns, as in an inverted
#   slider-crank: half of its Coriolis acceleration is missing, at every step.
# Right: 4 ω² R towards the centre: by the theorem of the inscribed angle the slider goes round on its circle of 1 m
#   at twice the crank's speed. Its place and its velocity are right to rounding, and on a line that stands still the
#   acceleration is, too.
# Cause: solve_prismatic_acceleration adds the terms d_dy vx - d_dx vy to the right-hand side, and then subtracts them
#   as “adjustment”, so that they are missing. The right-hand side without them needs the subtraction.
#
# Stated: 1.0926 m/s² of 4 off, at 1 rad/s and an angle of 0.5 rad
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q pylinkage==1.3.0 numpy

cat > "$place/proof.py" <<'END'
import math

from pylinkage.actuators import Crank
from pylinkage.components import Ground
from pylinkage.dyads import RRPDyad
from pylinkage.simulation import Linkage

RADIUS, SPEED = 1.0, 1.0  # m, rad/s
# A crank at the origin turns a line. A bar from (1, 0) holds the slider at 1 m. By the theorem of the inscribed
# angle the slider goes round on its circle, which passes through the origin, at twice the speed of the crank.
origin, centre = Ground(0.0, 0.0, name="origin"), Ground(RADIUS, 0.0, name="centre")
crank = Crank(anchor=origin, radius=1.0, angular_velocity=0.01, name="crank")
slider = RRPDyad(centre, origin, crank, RADIUS, x=2 * RADIUS, y=0.0, name="slider")
linkage = Linkage([origin, centre, crank, slider], name="inverted slider-crank")
linkage.set_input_velocity(crank, omega=SPEED)
*_, (places, velocities, accelerations) = linkage.step_with_derivatives(iterations=50)
angle = 2 * math.atan2(places[2][1], places[2][0])
place = (RADIUS + RADIUS * math.cos(angle), RADIUS * math.sin(angle))
velocity = (-2 * SPEED * RADIUS * math.sin(angle), 2 * SPEED * RADIUS * math.cos(angle))
right = (-4 * SPEED**2 * RADIUS * math.cos(angle), -4 * SPEED**2 * RADIUS * math.sin(angle))
assert math.dist(places[3], place) + math.dist(velocities[3], velocity) < 1e-12
print(math.dist(accelerations[3], right))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pylinkage 1.3.0: stated 1.0926, seen $seen m/s² of 4 off, at 1 rad/s and an angle of 0.5 rad"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.0926) <= 0.10926)' "$seen" || {
    echo "This has changed."
    exit 1
}
