"""A scene's spanning tree as an OpenSim model for Simbody: bodies, joints, closures, drivers and loads.

Every body frame has the link's origin and world-aligned axes at t = 0; coordinates start at zero.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from crosscheck.engine import Supports
from crosscheck.engines.shared.geometry import joint_frame
from crosscheck.engines.shared.initial_velocities import initial_rates
from crosscheck.engines.shared.spanning_tree import FREE, GROUND_LINK, Closure, Link, spanning_tree
from mbref.rotations import unit
from mbref.scene import Coupling, Driver, Force, Moment, Scene, Spring, TorsionSpring

JOINTS = {  # joint type → OpenSim's joint, and its coordinates in the tree's order
    "fixed": ("WeldJoint", ()),
    "revolute": ("PinJoint", (0,)),
    "universal": ("UniversalJoint", (0, 1)),
    "spherical": ("BallJoint", (0, 1, 2)),
    "translational": ("SliderJoint", (0,)),
    "cylindrical": ("CylindricalJoint", (1, 0)),
    "planar": ("PlanarJoint", (1, 2, 0)),
    FREE: ("FreeJoint", (3, 4, 5, 0, 1, 2)),
}
SUPPORTS = Supports(
    joints=(*(kind for kind in JOINTS if kind != FREE), "distance"),  # a distance joint is a rod in the tree
    drivers=("angle", "displacement"),
    loads=("moment", "force", "spring", "torsion_spring"),
    couplings=("angle", "displacement"),
    sums=True,
    armatures=("angle", "displacement"),  # refused by the engine with a reason
)
UNLIMITED = 1e9  # rad or m; limit of a coordinate's range, which OpenSim requires
LOCKED = 1e-12  # cosine of the second angle below which the first and third axis coincide


class Mechanism:
    """A scene in OpenSim: ``model``, its ``bodies`` and ``closures`` in the tree's order."""

    def __init__(self, scene: Scene):
        import opensim

        opensim.Logger.setLevelString("off")
        self.opensim, self.scene, self.tree = opensim, scene, spanning_tree(scene)
        self.model = opensim.Model()
        self.model.setGravity(opensim.Vec3(*scene.gravity))
        self.bodies: list[Any] = []
        self.coordinates: dict[int, Any] = {}  # keyed by joint velocity of the tree
        for k, link in enumerate(self.tree.links):
            self._add(k, link)
        self.closures = [self._close(k, closure) for k, closure in enumerate(self.tree.closures)]
        for driver in scene.driver:
            self._drive(driver)
        for k, coupling in enumerate(scene.coupling):
            self._couple(k, coupling)
        for k, load in enumerate(scene.load if scene.has_mass() else ()):
            self.model.addForce(self._force(f"load{k}", load))
        self.model.finalizeConnections()

    def start(self) -> Any:
        """Return the state at t = 0."""
        state = self.model.initSystem()
        for k, rate in enumerate(initial_rates(self.scene, self.tree)):
            self.coordinates[k].setSpeedValue(state, float(rate))
        return state

    def vector(self, values: Any) -> Any:
        """Return three numbers as OpenSim's vector."""
        return self.opensim.Vec3(*map(float, values))

    def frame(self, link: int) -> Any:
        """Return OpenSim's frame of a link or the ground."""
        return self.model.getGround() if link == GROUND_LINK else self.bodies[link]

    def place(self, link: int, point: Any) -> Any:
        """Return a point (world at t = 0) in the frame of a link."""
        origin = np.zeros(3) if link == GROUND_LINK else self.tree.links[link].position
        return self.vector(np.array(point) - origin)

    def _add(self, k: int, link: Link) -> None:
        o, i = self.opensim, link.inertia
        inertia = o.Inertia(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
        body = o.Body(f"body{k}", link.mass, self.vector(link.offset), inertia)
        self.model.addBody(body)
        self.bodies.append(body)
        kind, frame, order = _joint(link)
        turned = self.vector(_angles(frame))
        ends = [
            self.frame(link.parent),
            self.place(link.parent, link.anchor),
            turned,
            body,
            self.place(k, link.anchor),
            turned,
        ]
        if kind == "CylindricalJoint":
            joint = o.CustomJoint(f"joint{k}", *ends, self._cylindrical(k))
        else:
            joint = getattr(o, kind)(f"joint{k}", *ends)
        self.model.addJoint(joint)
        for n in range(link.freedoms):
            coordinate = joint.upd_coordinates(order[n])
            coordinate.setName(f"q{k}_{order[n]}")
            coordinate.setRangeMin(-UNLIMITED)
            coordinate.setRangeMax(UNLIMITED)
            self.coordinates[self.tree.starts[k] + n] = coordinate

    def _cylindrical(self, k: int) -> Any:
        """Return a joint with a rotation about and a translation along z, with coordinates in this order."""
        o = self.opensim
        transform = o.SpatialTransform()
        for n, axis in enumerate((transform.upd_rotation3(), transform.upd_translation3())):
            names = o.ArrayStr()
            names.append(f"q{k}_{n}")
            axis.setCoordinateNames(names)
            axis.set_function(o.LinearFunction(1.0, 0.0))
        return transform

    def _close(self, k: int, closure: Closure) -> Any:
        first, second = closure.links
        places = [self.place(link, closure.anchor) for link in closure.links]
        if closure.kind == "point":
            constraint = self.opensim.PointConstraint(
                self.frame(first), places[0], self.frame(second), places[1]
            )
        else:
            zero = self.vector((0, 0, 0))
            constraint = self.opensim.WeldConstraint(
                f"closure{k}", self.frame(first), places[0], zero, self.frame(second), places[1], zero
            )
        constraint.setName(f"closure{k}")
        self.model.addConstraint(constraint)
        return constraint

    def _couple(self, k: int, coupling: Coupling) -> None:
        """Add the last coordinate as a linear function of the others, by OpenSim's coupler."""
        o = self.opensim
        *others, last = (self.coordinates[i].getName() for i in self.tree.coupled(self.scene, coupling))
        names, slopes = o.ArrayStr(), o.ArrayDouble()
        for name, factor in zip(others, coupling.factors, strict=False):
            names.append(name)
            slopes.append(-factor / coupling.factors[-1])
        slopes.append(0.0)
        coupler = o.CoordinateCouplerConstraint()
        coupler.setName(f"coupling{k}")
        coupler.setIndependentCoordinateNames(names)
        coupler.setDependentCoordinateName(last)
        coupler.setFunction(o.LinearFunction(slopes))
        self.model.addConstraint(coupler)

    def _drive(self, driver: Driver) -> None:
        coordinate = self.coordinates[self.tree.coordinate(self.scene, driver.joint)]
        coordinate.setPrescribedFunction(self._motion(driver))
        coordinate.setDefaultIsPrescribed(True)

    def _motion(self, driver: Driver) -> Any:
        """Return the driver's value as OpenSim's function of time."""
        o, s = self.opensim, driver.sine
        if s is None:
            descending = o.Vector(len(driver.polynomial), 0.0)
            for n, c in enumerate(reversed(driver.polynomial)):
                descending.set(n, c)
            return o.PolynomialFunction(descending)
        return o.Sine(s.amplitude, s.frequency, s.phase, driver.polynomial[0])

    def _force(self, name: str, load: Any) -> Any:
        return FORCES[type(load)](self, name, load)

    def link_of(self, body: str) -> int:
        """Return the link of a scene's body, by name."""
        return self.tree.link_of(self.scene.body_index(body))


def _constants(mechanism: Mechanism, values: Any) -> list[Any]:
    return [mechanism.opensim.Constant(float(value)) for value in values]


def _moment(mechanism: Mechanism, name: str, load: Moment) -> Any:
    force = mechanism.opensim.PrescribedForce(name, mechanism.frame(mechanism.link_of(load.body)))
    force.setTorqueFunctions(*_constants(mechanism, load.moment))
    return force


def _point_force(mechanism: Mechanism, name: str, load: Force) -> Any:
    link = mechanism.link_of(load.body)
    force = mechanism.opensim.PrescribedForce(name, mechanism.frame(link))
    place = mechanism.place(link, load.point)
    force.setForceFunctions(*_constants(mechanism, load.force))
    force.setPointFunctions(*_constants(mechanism, [place[n] for n in range(3)]))
    return force


def _spring(mechanism: Mechanism, name: str, load: Spring) -> Any:
    """Return the force of a spring as a function of distance d and its rate; positive forces pull
    together."""
    force = mechanism.opensim.ExpressionBasedPointToPointForce()
    links = [mechanism.link_of(body) for body in load.bodies]
    first, second = (mechanism.frame(link) for link in links)
    force.setName(name)
    force.setBody1Name(first.getAbsolutePathString())
    force.setBody2Name(second.getAbsolutePathString())
    force.setPoint1(mechanism.place(links[0], load.points[0]))
    force.setPoint2(mechanism.place(links[1], load.points[1]))
    force.setExpression(f"({load.stiffness!r})*(d-({load.natural_length!r}))+({load.damping!r})*ddot")
    return force


def _torsion_spring(mechanism: Mechanism, name: str, load: TorsionSpring) -> Any:
    coordinate = mechanism.coordinates[mechanism.tree.coordinate(mechanism.scene, load.joint)]
    force = mechanism.opensim.SpringGeneralizedForce(coordinate.getName())
    force.setName(name)
    force.setStiffness(load.stiffness)
    force.setRestLength(load.natural_angle)
    force.setViscosity(load.damping)
    return force


FORCES: dict[type, Callable[..., Any]] = {
    Moment: _moment,
    Force: _point_force,
    Spring: _spring,
    TorsionSpring: _torsion_spring,
}


def _joint(link: Link) -> tuple[str, np.ndarray, tuple[int, ...]]:
    """Return OpenSim's joint of a link, its frame (3, 3), and the indices of its coordinates in the tree's
    order."""
    kind, order = JOINTS[link.kind]
    axes = link.axes
    if kind == "UniversalJoint":
        y = unit(axes[1] - (axes[1] @ axes[0]) * axes[0])
        return kind, np.column_stack([axes[0], y, np.cross(axes[0], y)]), order
    if kind == "SliderJoint":
        return kind, np.roll(joint_frame(axes[0]), 1, axis=1), order
    return kind, joint_frame(axes[0]) if len(axes) else np.eye(3), order


def _angles(r: np.ndarray) -> tuple[float, float, float]:
    """Return the angles of successive rotations about body-fixed x, y, z that give a rotation matrix (3,
    3)."""
    cosine = np.hypot(r[0, 0], r[0, 1])
    if cosine < LOCKED:
        return np.arctan2(r[2, 1], r[1, 1]), np.arctan2(r[0, 2], cosine), 0.0
    return np.arctan2(-r[1, 2], r[2, 2]), np.arctan2(r[0, 2], cosine), np.arctan2(-r[0, 1], r[0, 0])
