#!/usr/bin/env bash
# Finding sympy-sign-of-multipliers: sympy 1.14.0
#
# Does: Multipliers by LagrangesMethod.rhs() (mass_matrix_full, forcing_full) have the opposite sign of those in its
#   equations of motion, in solve_multipliers() and in linearize(). Put into linearize(), they make a hanging pendulum
#   unstable: its stiffness is +9.81 1/s².
# Right: -g / l = -9.81 1/s², which linearize() gives with the multiplier by solve_multipliers(); that one also meets
#   the equations of form_lagranges_equations(). Accelerations by rhs() are right.
# Cause: The equations have the term -lam_coeffs' lam, and mass_matrix has +lam_coeffs' in the columns of the
#   multipliers. Issue 30215 of sympy/sympy (open) names the stored sign, and not that results of one object
#   contradict each other.
#
# Stated: 19.62 1/s² of 9.81 off
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
import sympy
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

GRAVITY, MASS, LENGTH = sympy.Rational(981, 100), 2, 1  # m/s², kg, m
x, y = dynamicsymbols("x y")
(vx, vy), (ax, ay) = ([q.diff(dynamicsymbols._t, k) for q in (x, y)] for k in (1, 2))
lagrangian = MASS * (vx**2 + vy**2) / 2 - MASS * GRAVITY * y
method = LagrangesMethod(lagrangian, [x, y], hol_coneqs=[x**2 + y**2 - LENGTH**2])
equations = method.form_lagranges_equations()
hanging = {ax: 0, ay: 0, vx: 0, vy: 0, x: 0, y: -LENGTH}
solutions = method.mass_matrix_full.subs(hanging).LUsolve(method.forcing_full.subs(hanging))  # as in rhs()
[multiplier] = method.lam_vec


def stiffness(value):
    """Return the entry d²x/dt² by x of the linearisation for a value of the multiplier."""
    independent, dependent = {"q_ind": [x], "qd_ind": [vx]}, {"q_dep": [y], "qd_dep": [vy]}
    at = {**hanging, multiplier: value}
    return float(method.linearize(**independent, **dependent, op_point=at, A_and_B=True)[0][1, 0])


right = method.solve_multipliers(hanging)[multiplier]
assert equations.subs({**hanging, multiplier: right}).is_zero_matrix
assert abs(stiffness(right) + GRAVITY / LENGTH) < 1e-12
print(abs(stiffness(solutions[-1]) + GRAVITY / LENGTH))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "sympy 1.14.0: stated 19.62, seen $seen 1/s² of 9.81 off"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 19.62) <= 1.962)' "$seen" || {
    echo "This has changed."
    exit 1
}
