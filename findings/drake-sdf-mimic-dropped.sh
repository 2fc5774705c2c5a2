#!/usr/bin/env bash
# Finding drake-sdf-mimic-dropped: drake 1.51.1
#
# Does: The <mimic> of an axis in an SDF file gives no constraint and no message; the follower is free.
# Right: a constraint, as Drake makes from the <mimic> of a URDF.
# Cause: The parser of SDF makes nothing of the element; the plant has no constraint.
#
# Stated: 1 constraints missing
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q drake==1.51.1 numpy

cat > "$place/proof.py" <<'END'
import tempfile
from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

HINGE = '<joint name="{0}" type="revolute"><parent>world</parent><child>{1}</child><axis><xyz>0 1 0</xyz>{2}</axis></joint>'
parts = HINGE.format("lead", "a", "") + HINGE.format(
    "follow", "b", '<mimic joint="lead"><multiplier>2</multiplier></mimic>'
)
path = Path(tempfile.mkdtemp()) / "pair.sdf"
path.write_text(f'<sdf version="1.11"><model name="m"><link name="a"/><link name="b"/>{parts}</model></sdf>')
plant = MultibodyPlant(1e-3)
Parser(plant).AddModels(str(path))
plant.Finalize()
print(1 - plant.num_constraints())
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "drake 1.51.1: stated 1, seen $seen constraints missing"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 1) <= 0.1)' "$seen" || {
    echo "This has changed."
    exit 1
}
