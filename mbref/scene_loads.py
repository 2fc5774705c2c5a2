"""Loads as data: the fields of every load type, and its facts."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, get_args

from pydantic import Discriminator, ValidationInfo, field_validator

from mbref.scene_fields import Angle, Entry, Extent, Name, NotNegative, Pair, Point, PointPair, Vector


class LoadEntry(Entry):
    """The facts that all loads have: the field that names the one body, the two bodies or the joint a load
    acts on."""

    acts_on: ClassVar[Literal["body", "bodies", "joint"]]

    @property
    def is_damped(self) -> bool:
        """Whether the load takes energy out of the mechanism."""
        return getattr(self, "damping", 0.0) > 0


class Moment(LoadEntry):
    """Constant moment on a body (N m, world axes)."""

    acts_on = "body"
    type: Literal["moment"] = "moment"
    body: Name
    moment: Vector


class Force(LoadEntry):
    """Constant force (N, world axes) at a body-fixed point (given in the world at t = 0)."""

    acts_on = "body"
    type: Literal["force"] = "force"
    body: Name
    point: Point
    force: Vector


class Spring(LoadEntry):
    """Spring and damper between two body-fixed points (world at t = 0); N/m, N s/m, m."""

    acts_on = "bodies"
    type: Literal["spring"] = "spring"
    bodies: Pair
    points: PointPair
    stiffness: NotNegative
    damping: NotNegative = 0.0
    natural_length: Extent

    @field_validator("natural_length")
    @classmethod
    def _force_has_a_direction(cls, length: float, info: ValidationInfo) -> float:
        start, stop = info.data.get("points", (None, None))
        if length and start is not None and start == stop and info.data.get("stiffness"):
            raise ValueError("must be 0 between coincident points, where its force would have no direction")
        return length


class TorsionSpring(LoadEntry):
    """Spring and damper about a joint's axis; N m/rad, N m s/rad; angle measured from t = 0."""

    acts_on = "joint"
    type: Literal["torsion_spring"] = "torsion_spring"
    joint: Name
    stiffness: NotNegative
    damping: NotNegative = 0.0
    natural_angle: Angle = 0.0


Load = Annotated[Moment | Force | Spring | TorsionSpring, Discriminator("type")]
LOAD_TYPES: dict[str, type[Load]] = {
    load.model_fields["type"].default: load for load in get_args(get_args(Load)[0])
}
