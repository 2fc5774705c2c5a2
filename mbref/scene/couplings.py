"""Couplings as data: laws that relate the coordinates of joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, field_validator

from mbref.scene.fields import LengthOrAngle, Measure, Name, as_list, checked_length, shown
from mbref.scene.intervals import Intermittent
from mbref.scene.joints import ANGLE, DISPLACEMENT, Coordinate, Joint, JointFacts

MOST_POWERS = 9  # of a polynomial; a power in a unit has one digit


class Coupling(Intermittent):
    """q₂ = offset + ratio · q₁ of two joint coordinates, q₂ = offset + Σ polynomial[k] q₁^(k+1), or
    Σ ratios[k] q_k = offset of two or more: gears, racks, belts, screws, mimic joints; cams and knees;
    differentials, pulleys, planetary gears.

    A coordinate is the angle about a joint's axis (rad, full turns counted) or the displacement along it (m),
    of the second body relative to the first. All coordinates are zero at the poses that the scene gives;
    with an ``offset`` the motion starts at other poses (see ``Scene.assembled``). ``coordinates`` names the
    coordinate of each joint. The default is the only coordinate of the joint, or the angle of a cylindrical
    joint; for one joint named twice, its angle and its displacement.
    """

    name: Name
    joints: Annotated[tuple[Name, ...], BeforeValidator(as_list)]
    ratio: Measure | None = None  # rad/rad, m/rad, rad/m or m/m
    ratios: Annotated[tuple[Measure, ...], BeforeValidator(as_list)] | None = None  # over the last coordinate
    # factors of q₁, q₁², …: rad or m, over rad or m to the power of their place
    polynomial: (
        Annotated[tuple[Measure, ...], Field(min_length=1, max_length=MOST_POWERS), BeforeValidator(as_list)]
        | None
    ) = None
    offset: LengthOrAngle = 0.0  # rad or m, of the last coordinate
    coordinates: Annotated[tuple[Coordinate, ...], BeforeValidator(as_list)] | None = None

    @field_validator("joints")
    @classmethod
    def _joints_are_several(cls, joints: tuple[str, ...]) -> tuple[str, ...]:
        if len(joints) < 2:
            raise ValueError(f"must be two or more names of joints, got {shown(list(joints))}")
        return joints

    @field_validator("ratio", "ratios")
    @classmethod
    def _no_ratio_is_zero(cls, value: Any) -> Any:
        for ratio in value if isinstance(value, tuple) else () if value is None else (value,):
            if ratio == 0.0:
                last = "would lock the second joint" if value == 0.0 else "would leave out its joint"
                raise ValueError(f"must not be 0, which {last}")
            checked_length(abs(ratio))
        return value

    @field_validator("polynomial")
    @classmethod
    def _last_power_acts(cls, polynomial: Any) -> Any:
        if polynomial and polynomial[-1] == 0.0:
            raise ValueError("must not end with 0, which has no influence")
        return polynomial

    @property
    def laws(self) -> tuple[tuple[float, ...], ...]:
        """Coefficients of q, q², … for each joint coordinate q; the sum of these polynomials is the
        offset."""
        if self.polynomial is not None:
            return tuple(-each for each in self.polynomial), (1.0,)
        return tuple((ratio,) for ratio in self.ratios or (-(self.ratio or 0.0), 1.0))

    @property
    def powers(self) -> int:
        """Highest power of a joint coordinate, 1 for a linear coupling."""
        return max(map(len, self.laws))

    @property
    def factors(self) -> tuple[float, ...]:
        """Factors of the joint coordinates of a linear coupling, whose sum is the offset: ``ratios``, or
        (-ratio, 1); of a polynomial one, its slopes where all coordinates are zero."""
        return tuple(law[0] for law in self.laws)

    @property
    def gear_ratio(self) -> float:
        """Ratio r of a linear coupling of two joints, q₂ = offset + r · q₁."""
        first, second = self.factors
        return -first / second

    def from_pose(self, moved: float) -> Self:
        """Return the coupling with coordinates that count from a pose at which the first one is ``moved``
        (rad or m), and the others follow."""
        if self.powers == 1:
            return self
        law = np.polynomial.Polynomial([0.0, *(self.polynomial or ())])
        terms = law(np.polynomial.Polynomial([moved, 1.0])).coef[1:]
        return self.model_copy(update={"polynomial": tuple(terms.tolist())})

    def ends(self, joints: tuple[Joint, ...]) -> tuple[tuple[Joint, Coordinate], ...]:
        """Return the joints, each with its coupled coordinate."""
        chosen = self.coordinates or default_coordinates(self.joints, [joint.facts for joint in joints])
        return tuple(zip(joints, chosen, strict=True))


def default_coordinates(names: Sequence[str], facts: Sequence[JointFacts]) -> tuple[Coordinate, ...]:
    """Return the default coordinates of a coupling of joints with these names and facts: for a joint that is
    named twice its angle, then its displacement."""
    found: list[Coordinate] = []
    for k, (name, each) in enumerate(zip(names, facts, strict=True)):
        if list(names).count(name) > 1:
            found.append(DISPLACEMENT if name in names[:k] else ANGLE)
        else:
            found.append(each.main)
    return tuple(found)
