#!/usr/bin/env bash
# Finding mjx-step-changes-integer-types: mujoco-mjx 3.17.0
#
# Does: MJX's step returns other integer types than it is given where a model has a tendon and JAX computes in double
#   precision, so jax.lax.fori_loop over steps raises TypeError.
# Right: data of equal types before and after a step, as MJX has in single precision; crosscheck converts the results
#   of each step.
# Cause: The step computes ten_wrapadr, ten_wrapnum and wrap_obj with 64 bits; put_data makes them with 32 bits.
#
# Stated: 3 arrays of another type
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q mujoco-mjx==3.17.0 numpy

cat > "$place/proof.py" <<'END'
import jax
import mujoco
import numpy as np

jax.config.update("jax_enable_x64", True)
from mujoco import mjx

model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><site name="a" pos="0 0 1"/>
<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/><site name="b"/></body></worldbody>
<tendon><spatial stiffness="9"><site site="a"/><site site="b"/></spatial></tendon></mujoco>""")
before = mjx.put_data(model, mujoco.MjData(model))
after = jax.eval_shape(mjx.step, mjx.put_model(model), before)
changed = jax.tree.map(lambda old, new: old.dtype != new.dtype, before, after)
print(np.sum(jax.tree.leaves(changed)))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mujoco-mjx 3.17.0: stated 3, seen $seen arrays of another type"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 3) <= 0.3)' "$seen" || {
    echo "This has changed."
    exit 1
}
