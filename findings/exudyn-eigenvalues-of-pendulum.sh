#!/usr/bin/env bash
# Finding exudyn-eigenvalues-of-pendulum: exudyn 1.13.6
#
# Does: ComputeODE2Eigenvalues gives zero for a pendulum of a point and a distance constraint, and says nothing.
# Right: ω² = g / l = 9.81 1/s² for a point on a rod of 1 m; Exudyn's own run from 1e-3 rad is on the other side after
#   half that period, to 4e-7.
# Cause: The stiffness matrix leaves out how the constraint forces turn with the pose, also where the state contains
#   these forces, as here.
#
# Stated: 9.81 1/s² of 9.81 lost
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q exudyn==1.13.6 numpy scipy

cat > "$place/proof.py" <<'END'
import exudyn as exu

mbs = exu.SystemContainer().AddSystem()
ground = mbs.CreateGround()
point = mbs.CreateMassPoint(referencePosition=[0, -1, 0], mass=2, gravity=[0, -9.81, 0])
mbs.CreateDistanceConstraint(itemNumbers=[ground, point], distance=1.0)
mbs.Assemble()
settings = exu.SimulationSettings()
settings.timeIntegration.endTime = 0.01
settings.solutionSettings.writeSolutionToFile = False
mbs.SolveDynamic(settings)  # at rest, for the force of the constraint
still = mbs.systemData.GetSystemState()
mbs.systemData.SetSystemState(still, configuration=exu.ConfigurationType.Initial)
assert abs(still[3][0] - 2 * 9.81) < 1e-9
squares, _ = mbs.ComputeODE2Eigenvalues()
print(9.81 - squares[-1])
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "exudyn 1.13.6: stated 9.81, seen $seen 1/s² of 9.81 lost"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 9.81) <= 0.981)' "$seen" || {
    echo "This has changed."
    exit 1
}
