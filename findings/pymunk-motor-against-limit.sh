#!/usr/bin/env bash
# Finding pymunk-motor-against-limit: pymunk 7.3.1
#
# Does: SimpleMotor with a positive rate turns towards the lower limit of a RotaryLimitJoint between the same two
#   bodies in the same order: with limits of -1 and 2 rad the body ends at -1 rad.
# Right: 2 rad: the documentation calls the rate the desired relative angular velocity, and the limits the limits of
#   the relative rotation, whose rate is that velocity. RotaryLimitJoint(0.3, 0.3) holds the second body at 0.3 rad.
# Cause: SimpleMotor counts the first body's velocity minus the second's, as DampedRotarySpring does with its
#   rest_angle; RotaryLimitJoint counts the second minus the first.
#
# Stated: 3 rad from the limit
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


def angle(*joints):
    """Return the angle (rad) of a body after 10 s with joints between the ground and the body."""
    space, body = pymunk.Space(), pymunk.Body(1.0, 1.0)
    space.add(body, *(make(space.static_body, body) for make in joints))
    for _ in range(6000):
        space.step(1 / 600)
    return body.angle


def limit(lower, upper):
    return lambda ground, body: pymunk.RotaryLimitJoint(ground, body, lower, upper)


def motor(ground, body):
    made = pymunk.SimpleMotor(ground, body, 0.5)
    made.max_force = 0.1
    return made


assert abs(angle(limit(0.3, 0.3)) - 0.3) < 1e-6
print(2.0 - angle(limit(-1.0, 2.0), motor))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "pymunk 7.3.1: stated 3, seen $seen rad from the limit"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 3.0) <= 0.3)' "$seen" || {
    echo "This has changed."
    exit 1
}
