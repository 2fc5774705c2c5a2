"""Loads as data: the fields of every load type, and its facts."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple, get_args

from pydantic import Discriminator, ValidationInfo, field_validator

from mbref.scene.fields import (
    Angle,
    Damping,
    Extent,
    ForceSize,
    Length,
    MomentSize,
    Name,
    Pair,
    PointPair,
    PointValue,
    SceneEntry,
    Stiffness,
    Three,
    TorsionalDamping,
    TorsionalStiffness,
)
from mbref.scene.functions import Factor
from mbref.scene.joints import ANGLE, DISPLACEMENT, Coordinate


class LoadEntry(SceneEntry):
    """Facts that all loads have: the field that names the body, the two bodies or the joint on which a load
    acts."""

    acts_on: ClassVar[Literal["body", "bodies", "joint"]]

    @property
    def is_damped(self) -> bool:
        """True if the load dissipates energy."""
        return getattr(self, "damping", 0.0) > 0

    @property
    def over_time(self) -> Factor | None:
        """Function of time that multiplies the load; None for a load that does not depend on time."""
        return getattr(self, "factor", None)


class Moment(LoadEntry):
    """Moment on a body (N m, world axes), constant or times a ``factor``."""

    acts_on = "body"
    type: Literal["moment"] = "moment"
    body: Name
    moment: Three[MomentSize]
    factor: Factor | None = None


class Force(LoadEntry):
    """Force (N, world axes) at a body-fixed point (world at t = 0), constant or times a ``factor``."""

    acts_on = "body"
    type: Literal["force"] = "force"
    body: Name
    point: PointValue
    force: Three[ForceSize]
    factor: Factor | None = None


class Spring(LoadEntry):
    """Spring and damper between two body-fixed points (world at t = 0); N/m, N s/m, m."""

    acts_on = "bodies"
    type: Literal["spring"] = "spring"
    bodies: Pair
    points: PointPair
    stiffness: Stiffness
    damping: Damping = 0.0
    natural_length: Extent

    @field_validator("natural_length")
    @classmethod
    def _force_has_a_direction(cls, length: float, info: ValidationInfo) -> float:
        start, stop = info.data.get("points", (None, None))
        if length and start is not None and start == stop and info.data.get("stiffness"):
            raise ValueError("must be 0 between coincident points, where its force would have no direction")
        return length


class RotationalDamper(LoadEntry):
    """Moment -damping (ω₂ - ω₁) on the second body, the opposite on the first; N m s/rad."""

    acts_on = "bodies"
    type: Literal["rotational_damper"] = "rotational_damper"
    bodies: Pair
    damping: TorsionalDamping


class PointDamper(LoadEntry):
    """Force -damping v at a point of the second body (world at t = 0), the opposite on the first body at the
    same place; v is the velocity of the point as seen from the first body; N s/m."""

    acts_on = "bodies"
    type: Literal["point_damper"] = "point_damper"
    bodies: Pair
    point: PointValue
    damping: Damping


class Action(NamedTuple):
    """Force or torque ``amount`` - stiffness (q - natural) - damping q' along a joint coordinate q.

    The load acts on the second body, and with the opposite sign on the first body. Units are N m, N m/rad and
    N m s/rad for an angle q, and N, N/m and N s/m for a displacement q.
    """

    stiffness: float = 0.0
    damping: float = 0.0
    natural: float = 0.0
    amount: float = 0.0


class JointLoad(LoadEntry):
    """A load along one coordinate of a joint."""

    acts_on = "joint"
    coordinate: ClassVar[Coordinate]
    joint: Name

    @property
    def action(self) -> Action:
        """Coefficients of the force or torque along the joint coordinate."""
        amount = "torque" if self.coordinate == ANGLE else "force"
        fields = "stiffness", "damping", f"natural_{self.coordinate}", amount
        return Action(*(getattr(self, field, 0.0) for field in fields))


class TorsionSpring(JointLoad):
    """Spring and damper about a joint's axis; N m/rad, N m s/rad; angle measured from t = 0."""

    coordinate = ANGLE
    type: Literal["torsion_spring"] = "torsion_spring"
    stiffness: TorsionalStiffness
    damping: TorsionalDamping = 0.0
    natural_angle: Angle = 0.0


class SlideSpring(JointLoad):
    """Spring and damper along a joint's axis; N/m, N s/m; displacement measured from t = 0."""

    coordinate = DISPLACEMENT
    type: Literal["slide_spring"] = "slide_spring"
    stiffness: Stiffness
    damping: Damping = 0.0
    natural_displacement: Length = 0.0


class JointTorque(JointLoad):
    """Torque (N m) about a joint's axis, constant or times a ``factor``: a motor of known torque."""

    coordinate = ANGLE
    type: Literal["joint_torque"] = "joint_torque"
    torque: MomentSize
    factor: Factor | None = None


class JointForce(JointLoad):
    """Force (N) along a joint's axis, constant or times a ``factor``: an actuator of known force."""

    coordinate = DISPLACEMENT
    type: Literal["joint_force"] = "joint_force"
    force: ForceSize
    factor: Factor | None = None


Load = Annotated[
    Moment
    | Force
    | Spring
    | RotationalDamper
    | PointDamper
    | TorsionSpring
    | SlideSpring
    | JointTorque
    | JointForce,
    Discriminator("type"),
]
LOAD_TYPES: dict[str, type[Load]] = {
    load.model_fields["type"].default: load for load in get_args(get_args(Load)[0])
}
