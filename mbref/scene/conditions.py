"""Conditions at which a joint or a coupling begins to constrain the motion, or is released."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from mbref.scene.fields import LengthOrAngle, Name, Pair, PointPair, Positive, SceneEntry, unit_of

Component = Literal["x", "y", "z", "-x", "-y", "-z"]


class When(SceneEntry):
    """Value that a coordinate reaches: the angle (rad) or displacement (m) of a ``joint`` since the poses in
    the scene, or the distance (m) of two ``points`` (world, t = 0), each carried by one of ``bodies``.

    ``coordinate`` names the coordinate of a cylindrical joint; the default is its angle.
    """

    joint: Name | None = None
    coordinate: Literal["angle", "displacement"] | None = None
    bodies: Pair | None = None
    points: PointPair | None = None
    reaches: Annotated[LengthOrAngle, Field(validate_default=True)]

    @field_validator("reaches")
    @classmethod
    def _distance_is_positive(cls, reaches: float, info: ValidationInfo) -> float:
        if info.data.get("points") is not None and reaches <= 0.0:
            raise ValueError(f"must be positive, a distance at which points have met, got {reaches:g}")
        return reaches


class Release(SceneEntry):
    """Reaction that releases: the size of ``force`` (N) or ``moment`` (N m) on the second body of a joint.

    ``component`` names a component along a world axis, with its sign, instead of the size. ``joint`` names
    another joint than the released one; a coupling needs it.
    """

    force: Annotated[Positive, unit_of("force")] | None = None
    moment: Annotated[Positive, unit_of("moment")] | None = None
    component: Component | None = None
    joint: Name | None = None

    @property
    def limit(self) -> float:
        """Return the force (N) or moment (N m) above which the constraint is released."""
        return self.force or self.moment or 0.0
