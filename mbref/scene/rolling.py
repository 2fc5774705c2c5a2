"""Rolling joints as data: a wheel that rolls without slip on a plane, or along a line.

The rim of the wheel is a circle of the second body; the plane belongs to the first body.  The lowest point of
the circle touches the plane, which is one equation between positions, and does not slip, which are equations
between velocities alone (non-holonomic constraints): they do not restrict where the wheel can be, only how it
gets there.

- M, g, Φ_q, ν and γ contain the rows of slip as all other rows; they have no Φ.
- Baumgarte's feedback and the penalty of an augmented Lagrangian contain Φ' of such a row.
- Projections correct positions by the other rows alone, and velocities by all rows.
- Coordinate partitioning has more independent coordinates than independent rates.
- The forces of these rows act at a point of the wheel that is at rest on the plane: their power is zero.

The circle has one lowest point unless the wheel lies flat, where a run ends.
"""

from __future__ import annotations

import math
from typing import Literal, Self

import numpy as np
from pydantic import field_validator, model_validator

from mbref import rotations
from mbref.scene.fields import PositiveLength, VectorValue, direction
from mbref.scene.joint_facts import AxisJoint, JointFacts

FLAT = 1e-6  # sine of the angle between a wheel's axis and the normal of its plane, below which it lies flat
OBLIQUE = 0.05  # largest cosine between a line and the normal of its plane that counts as a right angle


class RollingWheel(AxisJoint):
    """Fields of a wheel: its centre ``anchor``, its ``axis``, and its ``radius``; and the ``normal`` of its
    plane, which points to the side of the wheel."""

    normal: VectorValue
    radius: PositiveLength

    _normal = field_validator("normal")(direction)

    @model_validator(mode="after")
    def _stands_on_its_rim(self) -> Self:
        sine = math.hypot(*rotations.cross(rotations.unit(self.axis), rotations.unit(self.normal)))
        if sine < FLAT:
            raise ValueError("the wheel lies flat on its plane, because axis and normal are parallel")
        return self

    @model_validator(mode="after")
    def _always_holds(self) -> Self:
        if not self.is_permanent:
            raise ValueError("a wheel rolls all the time: it has no active, when or release")
        return self

    @property
    def contact(self) -> VectorValue:
        """Return the lowest point of the rim, world at t = 0 (m): there the plane is."""
        d, n = rotations.unit(self.axis), rotations.unit(self.normal)
        up = rotations.unit(rotations.cross(rotations.cross(d, n), d))
        x, y, z = (float(c - self.radius * e) for c, e in zip(self.anchor, up, strict=True))
        return x, y, z

    @property
    def anchor_pair(self) -> tuple[VectorValue, VectorValue]:
        return self.contact, self.anchor

    @property
    def directions(self) -> tuple[VectorValue, ...]:
        return self.normal, self.axis

    @property
    def without_slip(self) -> tuple[VectorValue, ...]:
        """Return directions in the plane, world at t = 0, in which the point of contact does not slip."""
        raise NotImplementedError


class Rolling(RollingWheel):
    """A wheel of the second body rolls without slip on a plane of the first body."""

    facts = JointFacts(condition="contact", velocity_rows=2)
    type: Literal["rolling"] = "rolling"

    @property
    def without_slip(self) -> tuple[VectorValue, ...]:
        n = rotations.unit(self.normal)
        along = rotations.unit(rotations.cross(rotations.unit(self.axis), n))
        return _numbers(along), _numbers(rotations.cross(n, along))


class RollingLine(RollingWheel):
    """A wheel of the second body rolls without slip along a line of the first body, as on a rail or a rack;
    across the line it may slip."""

    facts = JointFacts(condition="contact", velocity_rows=1)
    type: Literal["rolling_line"] = "rolling_line"
    along: VectorValue

    _along = field_validator("along")(direction)

    @model_validator(mode="after")
    def _is_in_the_plane(self) -> Self:
        cosine = float(rotations.unit(self.along) @ rotations.unit(self.normal))
        if abs(cosine) > OBLIQUE:
            angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
            raise ValueError(f"along and normal must be perpendicular, but enclose {angle:.3g} degrees")
        return self

    @property
    def without_slip(self) -> tuple[VectorValue, ...]:
        n, along = rotations.unit(self.normal), rotations.unit(self.along)
        return (_numbers(rotations.unit(along - (along @ n) * n)),)


def _numbers(vector: np.ndarray) -> VectorValue:
    x, y, z = vector.tolist()
    return x, y, z
