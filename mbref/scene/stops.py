"""End stops: the range of a joint coordinate, at whose ends bodies bounce."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, ValidationInfo, field_validator

from mbref.scene.fields import LengthOrAngle, NotNegative, SceneEntry


class Stop(SceneEntry):
    """Range of a joint's coordinate, from ``lower`` to ``upper``, rad or m, from the poses in the scene.

    At an end the rate q' becomes -``restitution`` q', by an impulse without friction. A coordinate that does
    not bounce stays at the end while it is pushed there.
    """

    lower: LengthOrAngle | None = None
    upper: Annotated[LengthOrAngle | None, Field(validate_default=True)] = None
    restitution: Annotated[NotNegative, Field(le=1.0)] = 0.0

    @field_validator("lower")
    @classmethod
    def _starts_above(cls, lower: float | None) -> float | None:
        if lower is not None and lower > 0.0:
            raise ValueError(f"must not be above 0, where the coordinate starts, got {lower:g}")
        return lower

    @field_validator("upper")
    @classmethod
    def _starts_below(cls, upper: float | None, info: ValidationInfo) -> float | None:
        lower = info.data.get("lower")
        if upper is None and lower is None and "lower" in info.data:
            raise ValueError("or lower is required")
        if upper is not None and upper < 0.0:
            raise ValueError(f"must not be below 0, where the coordinate starts, got {upper:g}")
        if lower == upper == 0.0:
            raise ValueError("leaves no range between the ends; use a fixed joint")
        return upper

    def from_place(self, moved: float) -> Stop:
        """Return the range for a coordinate that counts from a place ``moved`` (rad or m) in the range."""
        lower = None if self.lower is None else min(self.lower - moved, 0.0)
        upper = None if self.upper is None else max(self.upper - moved, 0.0)
        return self.model_copy(update={"lower": lower, "upper": upper})
