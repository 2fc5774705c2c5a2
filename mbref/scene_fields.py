"""Types of a scene's fields, and the frozen table every entry of a scene is."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict


def as_list(value: Any) -> Any:
    """Arrays are accepted wherever the file has a list."""
    return value.tolist() if hasattr(value, "tolist") else value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Vector = Annotated[tuple[Real, Real, Real], Strict(False), BeforeValidator(as_list)]
Quaternion = Annotated[tuple[Real, Real, Real, Real], Strict(False), BeforeValidator(as_list)]
Name = Annotated[str, Field(min_length=1)]
Pair = Annotated[tuple[Name, Name], Strict(False)]
VectorPair = Annotated[tuple[Vector, Vector], Strict(False), BeforeValidator(as_list)]
Reals = Annotated[tuple[Real, ...], Field(min_length=1), Strict(False), BeforeValidator(as_list)]


def direction(v: tuple[float, float, float]) -> tuple[float, float, float]:
    """The vector itself; ValueError where it is zero."""
    if math.hypot(*v) == 0:
        raise ValueError("must have a length, got the zero vector")
    return v


class Entry(BaseModel):
    """A frozen table without unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")
