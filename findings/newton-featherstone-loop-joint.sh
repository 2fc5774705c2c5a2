#!/usr/bin/env bash
# Finding newton-featherstone-loop-joint: newton 1.8.0
#
# Does: SolverFeatherstone does not hold a joint that closes a loop, and says nothing: a four-bar falls apart.
# Right: a gap of nothing: the ball joint is part of the model, and other solvers of Newton hold it.
# Cause: The solver works on the joints of articulations alone; a joint outside them has no force.
#
# Stated: 0.338 m open after 0.2 s from rest
#
# This script installs the package in a temporary environment, runs the proof there, and compares the number that the
# proof prints with the stated one. Exit status: 0 if it is as stated, 1 if it has changed. It needs Python 3.11 or
# later, with venv, and a package index. `python -m reports.pages findings` wrote it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/environment"
python="$place/environment/bin/python"
"$python" -m pip install -q newton==1.8.0 numpy

cat > "$place/proof.py" <<'END'
import newton
import numpy as np
import warp as wp

wp.config.quiet = True
builder = newton.ModelBuilder(gravity=(0.0, -9.81, 0.0))
places = {"a": (0.0, 0.15, 0.0), "b": (0.35, 0.4, 0.0), "c": (0.7, 0.25, 0.0)}
links = {
    name: builder.add_link(
        xform=wp.transform(place, wp.quat_identity()),
        mass=1.0,
        inertia=wp.mat33(*np.diag([0.02, 0.02, 0.02]).ravel()),
    )
    for name, place in places.items()
}


def hinge(add, parent, child, point, **axis):
    ends = [
        wp.transform(tuple(np.subtract(point, places.get(name, (0.0, 0.0, 0.0)))), wp.quat_identity())
        for name in (parent, child)
    ]
    return add(
        parent=links.get(parent, -1), child=links[child], parent_xform=ends[0], child_xform=ends[1], **axis
    )


z = {"axis": (0.0, 0.0, 1.0)}
tree = [
    hinge(builder.add_joint_revolute, "ground", "a", (0.0, 0.0, 0.0), **z),
    hinge(builder.add_joint_revolute, "a", "b", (0.0, 0.3, 0.0), **z),
    hinge(builder.add_joint_revolute, "ground", "c", (0.7, 0.0, 0.0), **z),
]
hinge(builder.add_joint_ball, "b", "c", (0.7, 0.5, 0.0))  # closes the loop: in no articulation
builder.add_articulation(tree[:2])
builder.add_articulation(tree[2:])
model = builder.finalize(device="cpu", skip_validation_joints=True)
state, after = model.state(), model.state()
newton.eval_fk(model, model.joint_q, model.joint_qd, state)
solver = newton.solvers.SolverFeatherstone(model)
control = model.control()
for _ in range(200):
    state.clear_forces()
    solver.step(state, after, control, None, 1e-3)
    state, after = after, state
q = state.body_q.numpy()


def place(name, point):
    x, y, z, w = q[links[name], 3:]
    c, s = 1 - 2 * (y * y + z * z), 2 * (w * z + x * y)
    px, py = np.subtract(point, places[name])[:2]
    return q[links[name], :2] + [c * px - s * py, s * px + c * py]


print(np.linalg.norm(place("b", (0.7, 0.5, 0.0)) - place("c", (0.7, 0.5, 0.0))))
END
cd "$place"
seen=$("$python" proof.py | tail -n 1)
echo "newton 1.8.0: stated 0.338, seen $seen m open after 0.2 s from rest"
"$python" -c 'import sys; seen = float(sys.argv[1]); sys.exit(not abs(seen - 0.338) <= 0.0338)' "$seen" || {
    echo "This has changed."
    exit 1
}
