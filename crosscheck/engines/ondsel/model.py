"""A driven scene as an assembly of OndselSolver, and the tables of its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engine import Supports
from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.geometry import in_body, joint_frame, point_in_body
from crosscheck.judge.constraints import inertia_matrices
from mbref import rotations
from mbref.scene import GROUND, Driver, Joint, Scene

End = tuple[str, np.ndarray, np.ndarray]  # end of a joint: body, point, axes (columns)
JOINTS = {  # joint type → OndselSolver's joint
    "fixed": "fixed",
    "revolute": "revolute",
    "universal": "universal",
    "spherical": "spherical",
    "translational": "translational",
    "cylindrical": "cylindrical",
    "planar": "planar",
}
MOTIONS: dict[str | None, str] = {
    "angle": "rotational",
    "displacement": "translational",
}  # driven coordinate → OndselSolver's motion
SUPPORTS = Supports(
    joints=tuple(JOINTS),
    drivers=("angle", "displacement"),
    loads=("moment", "force", "spring", "torsion_spring"),  # loads do not change a prescribed motion
)
# joints whose accelerations are right only if the first body is at rest:
ACCURATE_ON_GROUND = ("cylindrical", "planar")
NAME = "scene"
TOLERANCE = 1e-9
TILT = rotations.from_vector(np.array([0.5, -0.4, 0.3]))


@dataclass(frozen=True)
class Table:
    """Rows of the result by series, such as ``"b0"`` or ``"j1"``, and label, such as ``"VX"``: (frames,)."""

    series: dict[str, dict[str, np.ndarray]]

    def three(self, name: str, *labels: str) -> np.ndarray:
        """Return (frames, 3) of three rows, in the assembly's world; zero for a series that the result
        lacks."""
        rows = self.series.get(name)
        if rows is None:
            frames = len(next(iter(self.series.values()))["X"])
            return np.zeros((frames, 3))
        return np.column_stack([rows[label] for label in labels])


class Assembly:
    """A scene in a turned world, with bodies in their principal axes.

    The solver returns orientations as three angles, which are singular if a body's third axis is along the
    first world axis. So the rotation ``world`` (4,) makes the first driver's axis the third world axis; with
    ``tilted`` a further rotation follows. ``principal`` (nb, 4) rotates principal axes to body axes. The
    third principal axis is the one nearest to the driver's axis.
    """

    def __init__(self, scene: Scene, tilted: bool = False):
        self.scene = scene
        axis = np.array(scene.joint_named(scene.driver[0].joint).directions[0])
        upright = rotations.from_matrix(joint_frame(axis).T)
        self.world = rotations.multiply(TILT, upright) if tilted else upright
        inertia = inertia_matrices(scene) if scene.has_mass() else np.array([np.eye(3)] * len(scene.body))
        found = [
            _principal(matrix, in_body(scene, body.name, axis))
            for matrix, body in zip(inertia, scene.body, strict=True)
        ]
        self.moments = [moments for moments, _ in found]
        self.axes = [axes for _, axes in found]
        self.principal = rotations.from_matrix(np.array(self.axes))

    def text(self, t0: float, t1: float, frames: int, position: np.ndarray, orientation: np.ndarray) -> str:
        """Return the text of the assembly with poses (nb, 3), (nb, 4; body axes) at t0, to be moved to t1 in
        equal steps."""
        from pyondsel.model.asmt_model import AsmtModel
        from pyondsel.model.simulation import Simulation

        end = t1 - t0
        simulation = Simulation(0.0, end, frames, end * 1e-9, end, TOLERANCE)
        gravity = rotations.rotate(self.world, np.array(self.scene.gravity))
        model = AsmtModel(NAME, gravity=_tuple(gravity), simulation=simulation)
        parts = self._parts(position, orientation)
        for part in parts:
            model.add_part(part)
        drivers = {driver.joint: driver for driver in self.scene.driver}
        for k, joint in enumerate(self.scene.joint):
            self._join(model, parts, k, joint, drivers.get(joint.name), t0)
        return model.to_asmt()

    def _parts(self, position: np.ndarray, orientation: np.ndarray) -> list[Any]:
        from pyondsel.model.part import Part

        position = rotations.rotate(self.world, position)
        turned = rotations.multiply(self.world, rotations.multiply(orientation, self.principal))
        turned = rotations.to_matrix(turned)
        return [
            Part(
                f"b{k}",
                _tuple(position[k]),
                _matrix(turned[k]),
                body.mass or 1.0,
                moments_of_inertia=_tuple(self.moments[k]),
            )
            for k, body in enumerate(self.scene.body)
        ]

    def _join(
        self, model: Any, parts: list[Any], k: int, joint: Joint, driver: Driver | None, t0: float
    ) -> None:
        from pyondsel.model.joint import Joint as OndselJoint
        from pyondsel.model.marker import Marker
        from pyondsel.model.motion import Motion

        paths = []
        sign = -1.0 if is_reversed(joint) else 1.0
        turned = sign * motion(driver, t0)[0] if driver and joint.facts.driven == "angle" else 0.0
        ends = self.ends(joint)[:: int(sign)]
        for side, (name, point, frame) in enumerate([ends[0], _turned_back(*ends[1], turned)]):
            world = rotations.to_matrix(self.world) if name == GROUND else np.eye(3)
            marker = Marker(f"m{k}{side}", _tuple(world @ point), _matrix(world @ frame))
            if name == GROUND:
                model.add_ground_marker(marker)
                paths.append(model.ground_path(marker.name))
            else:
                part = parts[self.scene.body_index(name)]
                part.add_marker(marker)
                paths.append(model.part_path(part.name, marker.name))
        model.add_joint(OndselJoint(f"j{k}", JOINTS[joint.type], *paths))
        if driver:
            text = _expression(driver, t0, turned, sign)
            model.add_motion(Motion(f"d{k}", f"j{k}", text, MOTIONS[joint.facts.driven]))

    def ends(self, joint: Joint) -> list[End]:
        """Return body, point and axes (3, 3, columns) of a joint's two markers, in principal axes."""
        ends = []
        for name, frame in zip(joint.bodies, _frames(joint), strict=True):
            point, axes = (
                point_in_body(self.scene, name, joint.anchor_pair[0]),
                in_body(self.scene, name, frame.T).T,
            )
            if name != GROUND:
                own = self.axes[self.scene.body_index(name)]
                point, axes = own.T @ point, own.T @ axes
            ends.append((name, point, axes))
        return ends


def is_reversed(joint: Joint) -> bool:
    """Return whether the solver receives the joint's second body as its first one, because the second body is
    the ground."""
    return joint.type in ACCURATE_ON_GROUND and joint.bodies[1] == GROUND


def _turned_back(name: str, point: np.ndarray, axes: np.ndarray, angle: float) -> End:
    """Return a marker rotated back about its third axis by the driver's angle so far: the solver's angles
    start at zero."""
    c, s = np.cos(angle), np.sin(angle)
    return name, point, axes @ [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]


def _principal(inertia: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return principal moments and axes (3, 3, columns) of an inertia, the last axis nearest to ``axis``
    (3,)."""
    moments, axes = np.linalg.eigh(inertia)
    last = int(np.argmax(np.abs(axes.T @ axis)))
    order = [(last + 1) % 3, (last + 2) % 3, last]
    axes = axes[:, order]
    return moments[order], axes * [1.0, 1.0, np.sign(np.linalg.det(axes))]


def _frames(joint: Joint) -> list[np.ndarray]:
    """Return the axes (3, 3, columns, world at t = 0) of the two markers; the joint's axis is the third."""
    frames = [joint_frame(axis) for axis in joint.directions] or [np.eye(3)]
    return [frames[0], frames[-1]]


def _expression(driver: Driver, t0: float, turned: float, sign: float) -> str:
    """Return the driver's value times ``sign``, minus the angle ``turned`` (rad), as an expression in
    OndselSolver's syntax."""
    t = f"(time + {t0!r})"
    terms = ["*".join([f"({sign * c!r})"] + [t] * n) for n, c in enumerate(driver.polynomial)]
    if s := driver.sine:
        terms.append(f"({sign * s.amplitude!r})*sin(({s.frequency!r})*{t} + ({s.phase!r}))")
    return " + ".join([*terms, f"({-float(turned)!r})"])


def table(answer: str, frames: int) -> Table:
    """Return the time series of a result; its first column, the given poses, is left out.

    Raises ValueError when the analysis ended before all its frames.
    """
    series: dict[str, dict[str, np.ndarray]] = {}
    rows: dict[str, np.ndarray] = {}
    for line in answer[answer.index("TimeSeries") :].splitlines()[3:]:
        label, *cells = line.rstrip("\t").split("\t")
        if cells and cells[0].startswith("/"):
            rows = series.setdefault(cells[0].rsplit("/", 1)[-1], {})
        elif len(cells) != frames + 2:
            raise ValueError(f"the analysis ended after {max(len(cells) - 2, 0)} of {frames} steps")
        else:
            rows[label] = np.array(cells[1:], dtype=float)
    return Table(series)


def _tuple(values: np.ndarray) -> tuple[float, ...]:
    return tuple(map(float, values))


def _matrix(values: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(map(_tuple, values))
