"""Couplings as data: two joint coordinates that move in a constant ratio, such as the angles of two gears."""

from __future__ import annotations

from pydantic import field_validator

from mbref.scene_fields import Entry, Name, Pair, Real, checked_length
from mbref.scene_joints import ANGLE, DISPLACEMENT, Coordinate, Joint, JointFacts

CoordinatePair = tuple[Coordinate, Coordinate]


class Coupling(Entry):
    """q₂ = ratio · q₁ of two joint coordinates: gears, racks, belts, screws, mimic joints.

    A coordinate is the angle about a joint's axis (rad, full turns counted) or the displacement along it (m),
    of the second body relative to the first. Both coordinates are zero at the poses that the scene gives.
    ``coordinates`` names the coordinate of each joint. The default is the coordinate that a driver of the
    joint would prescribe; for one joint named twice, its angle and its displacement.
    """

    name: Name
    joints: Pair
    ratio: Real  # rad/rad, m/rad, rad/m or m/m
    coordinates: CoordinatePair | None = None

    @field_validator("ratio")
    @classmethod
    def _ratio_is_not_zero(cls, ratio: float) -> float:
        if ratio == 0.0:
            raise ValueError("must not be 0, which would lock the second joint")
        checked_length(abs(ratio))
        return ratio

    def pairs(self, joints: tuple[Joint, Joint]) -> tuple[tuple[Joint, Coordinate], ...]:
        """Return both joints, each with its coupled coordinate."""
        facts = joints[0].facts, joints[1].facts
        chosen = self.coordinates or default_coordinates(facts, self.joints[0] == self.joints[1])
        return tuple(zip(joints, chosen, strict=True))


def default_coordinates(facts: tuple[JointFacts, JointFacts], of_one: bool) -> CoordinatePair:
    """Return the default coordinates of a coupling of two joints, or of one joint named twice
    (``of_one``)."""
    if of_one:
        return ANGLE, DISPLACEMENT
    first, second = (each.driven or ANGLE for each in facts)
    return first, second
