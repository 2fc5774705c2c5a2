"""Shapes of homogeneous bodies as data: volume, and moments of inertia about the centre of mass."""

from __future__ import annotations

import math
from typing import Annotated, Literal, get_args

from pydantic import Discriminator, ValidationInfo, field_validator

from mbref.scene.fields import PositiveLength, SceneEntry, Three

Moments = tuple[float, float, float]


class ShapeEntry(SceneEntry):
    """Facts that all shapes have: the volume (m³), and the principal moments over the mass (m²) along the
    body's axes."""

    @property
    def volume(self) -> float:
        """Volume, m³."""
        raise NotImplementedError

    @property
    def moments_over_mass(self) -> Moments:
        """Principal moments of inertia about the centre of mass, divided by the mass, m²."""
        raise NotImplementedError


class Box(ShapeEntry):
    """Block of edges ``size`` along the body's axes x, y, z (m)."""

    type: Literal["box"] = "box"
    size: Three[PositiveLength]

    @property
    def volume(self) -> float:
        return math.prod(self.size)

    @property
    def moments_over_mass(self) -> Moments:
        a, b, c = (edge**2 / 12 for edge in self.size)
        return b + c, a + c, a + b


class Sphere(ShapeEntry):
    """Ball of a ``radius`` (m)."""

    type: Literal["sphere"] = "sphere"
    radius: PositiveLength

    @property
    def volume(self) -> float:
        return 4 / 3 * math.pi * self.radius**3

    @property
    def moments_over_mass(self) -> Moments:
        moment = 0.4 * self.radius**2
        return moment, moment, moment


class _LongShape(ShapeEntry):
    axis: Literal["x", "y", "z"]  # axis of the body along which the length lies
    length: PositiveLength

    @property
    def section(self) -> tuple[float, float]:
        """Area of the cross-section (m²), and its second moment over the area, about a diameter (m²)."""
        raise NotImplementedError

    @property
    def volume(self) -> float:
        return self.section[0] * self.length

    @property
    def moments_over_mass(self) -> Moments:
        across = self.section[1]
        along = "xyz".index(self.axis)
        x, y, z = (2 * across if k == along else across + self.length**2 / 12 for k in range(3))
        return x, y, z


class Rod(_LongShape):
    """Thin rod of a ``length`` (m) along an ``axis`` of the body, without moment about this axis."""

    type: Literal["rod"] = "rod"

    @property
    def section(self) -> tuple[float, float]:
        return 0.0, 0.0


class Cylinder(_LongShape):
    """Cylinder of a ``radius`` and ``length`` (m) along an ``axis`` of the body."""

    type: Literal["cylinder"] = "cylinder"
    radius: PositiveLength

    @property
    def section(self) -> tuple[float, float]:
        return math.pi * self.radius**2, self.radius**2 / 4


class Tube(_LongShape):
    """Hollow cylinder between ``inner_radius`` and ``radius`` (m)."""

    type: Literal["tube"] = "tube"
    radius: PositiveLength
    inner_radius: PositiveLength

    @field_validator("inner_radius")
    @classmethod
    def _wall_has_a_thickness(cls, inner: float, info: ValidationInfo) -> float:
        if inner >= info.data.get("radius", math.inf):
            raise ValueError(f"must be less than radius, {info.data['radius']:g} m, got {inner:g}")
        return inner

    @property
    def section(self) -> tuple[float, float]:
        outer, inner = self.radius**2, self.inner_radius**2
        return math.pi * (outer - inner), (outer + inner) / 4


Solid = Annotated[Box | Sphere | Rod | Cylinder | Tube, Discriminator("type")]
SHAPE_TYPES: dict[str, type[Solid]] = {
    shape.model_fields["type"].default: shape for shape in get_args(get_args(Solid)[0])
}
