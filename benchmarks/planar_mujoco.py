"""Planar mechanisms as an expert would write them for MuJoCo: hinges and slides of a spanning tree in the
plane, and one ``connect`` for each loop.

The generic mapping of a scene has three dimensions; this is the least that MuJoCo needs. The compliance of
closures is scaled down and their error fed back at a rate of 1/s; unused parts of MuJoCo are switched off.
"""

from __future__ import annotations

import heapq
import time
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.mujoco.compiled_run import leave_out_unused
from mbref.scene import Body, Fixed, Joint, Scene, Translational

STIFFEST = "0.9999 0.9999 0.001"
UNUSED = " ".join(f'{name}="disable"' for name in ("island", "spring", "damper", "autoreset", "refsafe"))
FEEDBACK = "-1 -2"  # stiffness and damping of a closure's error (1/s², 1/s)
# initial letters of the joints that close a loop, and of joints that repeat other joints, by family
CLOSED = {"four_bar_chain": "C", "slider_crank_chain": "C", "lattice": "C", "strandbeest": "TUX"}


class Solver(NamedTuple):
    """Settings by which MuJoCo satisfies closures: form of the Jacobian, solver, factor ``scale`` on their
    compliance, iterations, steps of the line search."""

    jacobian: str
    name: str
    scale: float
    iterations: int
    line_search: int


# several iterations with a sparse Jacobian are wrong on some scenes with many loops; dense ones are right
SOLVERS = (
    Solver("sparse", "Newton", 1e-4, 1, 1),
    Solver("sparse", "Newton", 1e-8, 2, 4),
    Solver("dense", "Newton", 1e-4, 1, 1),
    Solver("dense", "Newton", 1e-8, 2, 4),
)


class Model:
    """A compiled planar model of a scene, run again and again from the scene's start."""

    def __init__(self, scene: Scene, velocity: np.ndarray, spin: np.ndarray, solver: Solver, step: float):
        """Compile the model; ``velocity`` (nb, 3) and ``spin`` (nb,) are consistent rates about z."""
        import mujoco

        self.mujoco = mujoco
        self.tree, closed = _spanning_tree(scene)
        self.model = mujoco.MjModel.from_xml_string(_xml(scene, self.tree, closed, solver, step))
        leave_out_unused(mujoco, self.model)
        self.model.body_invweight0[:] *= solver.scale
        self.model.dof_invweight0[:] *= solver.scale
        self.model.opt.iterations, self.model.opt.ls_iterations = solver.iterations, solver.line_search
        numbers = {body.name: k for k, body in enumerate(scene.body)}
        order = [self.model.body(body.name).id for body in scene.body]
        self._order, self._start = np.array(order), np.zeros(self.model.nv)
        for joint in self.tree:
            if not isinstance(joint, Fixed):
                first, second = (numbers.get(name, -1) for name in joint.bodies)
                place = self.model.joint(joint.name).dofadr[0]
                if isinstance(joint, Translational):
                    self._start[place] = velocity[second] @ np.array(joint.axis)
                else:
                    self._start[place] = spin[second] - (spin[first] if first >= 0 else 0.0)

    def run(self, steps: int) -> tuple[float, np.ndarray]:
        """Return the process CPU seconds of a number of steps by RK4, and the centres (nb, 3) then."""
        data = self.mujoco.MjData(self.model)
        data.qvel[:] = self._start
        began = time.process_time()
        self.mujoco.mj_step(self.model, data, nstep=steps)
        seconds = time.process_time() - began
        self.mujoco.mj_kinematics(self.model, data)
        return seconds, data.xipos[self._order]


def _spanning_tree(scene: Scene) -> tuple[list[Joint], list[Joint]]:
    """Return the joints of the spanning tree, and the joints that close a loop.

    Fixed joints come first, so that all further bearings of a shaft are left out: they repeat the first one.
    """
    letters = CLOSED[scene.name.partition("[")[0]]
    from_body: dict[str, list[tuple[bool, int]]] = {}
    for k, joint in enumerate(scene.joint):
        if joint.name[0] not in letters:
            from_body.setdefault(joint.bodies[0], []).append((not isinstance(joint, Fixed), k))
    held, tree, waiting = {"ground"}, [], list(from_body["ground"])
    while waiting:
        joint = scene.joint[heapq.heappop(waiting)[1]]
        if joint.bodies[1] not in held:
            tree.append(joint)
            held.add(joint.bodies[1])
            for other in from_body.get(joint.bodies[1], []):
                heapq.heappush(waiting, other)
    return tree, [joint for joint in scene.joint if joint.name[0] in letters]


def _xml(scene: Scene, tree: list[Joint], closed: list[Joint], solver: Solver, step: float) -> str:
    bodies, carried = {body.name: body for body in scene.body}, {}
    for joint in tree:
        carried.setdefault(joint.bodies[0], []).append(joint)

    def subtree(name: str) -> str:
        return "".join(
            _body(joint, bodies[joint.bodies[1]], bodies.get(name)) + subtree(joint.bodies[1]) + "</body>"
            for joint in carried.get(name, [])
        )

    loops = "".join(
        f'<connect body1="{joint.bodies[0]}" body2="{joint.bodies[1]}" '
        f'anchor="{_text(np.subtract(joint.anchor, bodies[joint.bodies[0]].position))}"/>'
        for joint in closed
    )
    return (
        f'<mujoco><option gravity="{_text(scene.gravity)}" integrator="RK4" timestep="{step!r}" '
        f'tolerance="0" jacobian="{solver.jacobian}" solver="{solver.name}"><flag {UNUSED}/></option>'
        f'<size memory="2000M"/><default><equality solref="{FEEDBACK}" solimp="{STIFFEST}"/></default>'
        f"<worldbody>{subtree('ground')}</worldbody><equality>{loops}</equality></mujoco>"
    )


def _body(joint: Joint, body: Body, parent: Body | None) -> str:
    """Return the opening of a body in world axes, with its centre of mass as origin."""
    place, before = np.array(body.position), np.zeros(3) if parent is None else np.array(parent.position)
    inertia = _text([body.inertia[2]] * 3)
    kind, axis = ("slide", joint.axis) if isinstance(joint, Translational) else ("hinge", (0.0, 0.0, 1.0))
    moves = (
        f'<joint name="{joint.name}" type="{kind}" axis="{_text(axis)}" pos="{_text(joint.anchor - place)}"/>'
    )
    return (
        f'<body name="{body.name}" pos="{_text(place - before)}"><inertial pos="0 0 0" mass="{body.mass!r}" '
        f'diaginertia="{inertia}"/>{"" if isinstance(joint, Fixed) else moves}'
    )


def _text(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)
