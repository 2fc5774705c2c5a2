#!/usr/bin/env bash
# Finding sympy-quaternion-of-half-turn: sympy 1.14.0
#
# Does: Quaternion.from_rotation_matrix returns the quaternion 0 for half a turn, whatever its axis, and says nothing.
# Right: ±i for half a turn about x, whose to_rotation_matrix is this matrix.
# Cause: The signs of i, j, k come from differences of off-diagonal terms, which are 0 for half a turn, and the
#   function sets a term to 0 where the sign is 0.
#
# Stated: 1 of the norm 1 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q sympy==1.14.0 numpy

cat > "$place/proof.py" <<'END'
from sympy import Matrix, Quaternion, sqrt

half_turn = Matrix([[1, 0, 0], [0, -1, 0], [0, 0, -1]])  # about x
right = Quaternion(0, 1, 0, 0)
assert right.to_rotation_matrix() == half_turn
found = Quaternion.from_rotation_matrix(half_turn)
print(float(1 - sqrt(found.a**2 + found.b**2 + found.c**2 + found.d**2)))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "sympy 1.14.0: stated 1, seen $seen of the norm 1 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.0) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
