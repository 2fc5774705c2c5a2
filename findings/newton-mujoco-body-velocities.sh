#!/usr/bin/env bash
# Finding newton-mujoco-body-velocities: newton 1.8.0
#
# Does: SolverMuJoCo ignores the velocities in State.body_qd, and says nothing: a body that is given 1 m/s stands
#   still.
# Right: 1 m/s, which Kamino, XPBD and SemiImplicit keep; State.body_qd is the state of the bodies.
# Cause: The solver reads joint_qd alone, and sets body_qd from it after the step.
#
# Stated: 1 m/s of 1 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q newton==1.8.0 numpy mujoco==3.17.0 mujoco-warp==3.17.0

cat > "$place/proof.py" <<'END'
import newton
import warp as wp

builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
builder.add_body(mass=1.0, inertia=wp.mat33(0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.1))
model = builder.finalize(device="cpu")
before, after = model.state(), model.state()
before.body_qd.assign([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
newton.solvers.SolverMuJoCo(model).step(before, after, model.control(), None, 1e-3)
print(1.0 - after.body_qd.numpy()[0, 0])
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "newton 1.8.0: stated 1, seen $seen m/s of 1 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1.0) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
