#!/usr/bin/env bash
# Finding mink-tendon-equality: mink 1.3.0
#
# Does: EqualityConstraintTask reports an error of 0 for a <tendon> equality that is open, and solve_ik leaves it
#   open, where the constraint Jacobian is sparse (jacobian="sparse", or 60 degrees of freedom). Where it is dense,
#   solve_ik ends with an exception on shapes.
# Right: two hinges, coupled by their tendons, that meet, as with a <joint> equality of the same hinges. The
#   documentation of the task lists mjEQ_TENDON.
# Cause: Configuration.update calls mj_kinematics, mj_comPos and mj_makeConstraint, but not mj_tendon: lengths and
#   Jacobians of tendons stay zero. After mj_fwdPosition they would be right.
#
# Stated: 0.4 rad open, at an error of 0
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q mink==1.3.0 numpy

cat > "$place/proof.py" <<'END'
import mink
import mujoco
import numpy as np

BODY = '<body><joint name="{}" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
TENDON = '<fixed name="t{0}"><joint joint="{0}" coef="1"/></fixed>'
MODEL = f"""<mujoco><option jacobian="sparse"/>
<worldbody>{BODY.format("a")}{BODY.format("b")}</worldbody>
<tendon>{TENDON.format("a")}{TENDON.format("b")}</tendon><equality>{{}}</equality></mujoco>"""


def gap(equality):
    """Return how far two hinges are apart after ten steps of inverse kinematics with an equality."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(equality))
    configuration = mink.Configuration(model, q=np.array([0.5, 0.1]))
    task = mink.EqualityConstraintTask(model, cost=1.0)
    for _ in range(10):
        configuration.integrate_inplace(mink.solve_ik(configuration, [task], 1.0, solver="daqp"), 1.0)
    assert np.abs(task.compute_error(configuration)).max() < 1e-9  # the task's own error
    return abs(configuration.q[0] - configuration.q[1])


assert gap('<joint joint1="a" joint2="b"/>') < 1e-9
print(gap('<tendon tendon1="ta" tendon2="tb"/>'))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "mink 1.3.0: stated 0.4, seen $seen rad open, at an error of 0"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.4) <= 0.04)' "$seen" || {
    echo "This has changed."
    exit 1
}
