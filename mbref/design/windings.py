"""Equilibria in other windings of torsion springs: each spring is turned from each equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mbref.design.balance import ONE_POSE, STRIDE, Newton, balanced
from mbref.design.joint_angles import sprung
from mbref.design.linearisation import Tangent
from mbref.design.winding import angle_derivatives

TURN_STEP = 0.15  # rad; turn of a spring between neighbouring poses
MOST_POSES = 2400  # largest number of poses in a search; 1 / f² of it with f freedoms, which cost more
POSES_OF_NEWTON = 30  # poses that cost as much as an equilibrium by Newton's method
LEAST_PROGRESS = 0.1  # turn / TURN_STEP below which a joint is taken to be at a limit of its motion
NEIGHBOURS = 4 * TURN_STEP  # distance, rad or lengths, of two equilibria between which a third one is sought
SOFT = 4.0  # moment of a spring at half a turn / moment of all forces on its joint, below which it is turned


class Windings:
    """A search that turns springs: equilibria (Newton) in the order in which they are found."""

    def __init__(self, found: list[Newton], freedoms: int, are_one: Callable[[Newton, Newton], bool]):
        self.found, self.freedoms, self.are_one = found, freedoms, are_one
        self.left, self.turned = MOST_POSES // max(1, freedoms) ** 2, set[tuple[int, int]]()

    def search(self) -> None:
        """Add the equilibria that are met where each soft spring is turned both ways from each equilibrium.

        A spring that was turned through an equilibrium is not turned again from there.
        """
        for place, here in enumerate(self.found):  # grows
            if here.tangent.freedoms == self.freedoms:
                for spring in _soft_springs(here.tangent):
                    if (place, spring) not in self.turned:
                        self._turn(here, spring, 1)
                        self._turn(here, spring, -1)

    def _turn(self, here: Newton, spring: int, way: int) -> None:
        """Add the equilibria on one way from an equilibrium."""
        last = here
        for start in self._starts(here.tangent, spring, way):
            self.left -= POSES_OF_NEWTON
            settled = balanced(start, self.freedoms, self.found)
            if settled is None:
                continue
            self._add(settled, spring)
            apart = last.tangent.coordinates(last.tangent.to(settled.tangent))
            if ONE_POSE < np.linalg.norm(last.tangent.basis @ apart) < NEIGHBOURS:
                middle = last.tangent.moved(0.5 * apart)
                if middle and (third := balanced(middle, self.freedoms, self.found)):
                    self._add(third, spring)
            last = settled

    def _add(self, settled: Newton, spring: int) -> None:
        """Add an equilibrium, unless it is known."""
        known = (k for k, other in enumerate(self.found) if self.are_one(settled, other))
        place = next(known, len(self.found))
        self.turned.add((place, spring))
        if place == len(self.found):
            self.found.append(settled)

    def _starts(self, here: Tangent, spring: int, way: int) -> Iterator[Tangent]:
        """Yield the poses next to those at which the turned spring's joint is in balance.

        There the joint's acceleration changes its sign, or has an extremum near zero. The way ends after
        a full turn against the acceleration.
        """
        before: list[tuple[Tangent, float]] = []
        against = 0.0
        for pose, turned in self._poses(here, spring, way):
            ahead = way * float(_derivatives(pose)[spring] @ pose.coordinates(pose.off_balance()))
            before = [*before[-2:], (pose, ahead)]
            signs = [a > 0.0 for _, a in before]
            if len(before) == 1:
                yield pose
            elif signs[-1] != signs[-2]:
                yield before[-2][0]
                yield pose
            elif len(before) == 3 and signs[0] == signs[1] and _may_vanish(*(a for _, a in before)):
                yield before[0][0]
                yield pose
            against = 0.0 if signs[-1] else against + turned
            if against > 2 * np.pi:
                return

    def _poses(self, here: Tangent, spring: int, way: int) -> Iterator[tuple[Tangent, float]]:
        """Yield poses along the turn of a spring, whose neighbours are held as far as the joints allow, and
        the turn (rad) since the last one."""
        slot = here.model.data.loads.angle[sprung(here.model)].astype(int)[spring]
        while self.left > 0:
            self.left -= 1
            rows = _derivatives(here)
            step = np.linalg.lstsq(rows, np.eye(len(rows))[spring], rcond=None)[0]
            gain, size = float(rows[spring] @ step), float(np.linalg.norm(here.basis @ step))
            if not gain * STRIDE > LEAST_PROGRESS * TURN_STEP * size:
                return
            moved = here.moved(way * min(TURN_STEP / gain, STRIDE / size) * step)
            if moved is None or moved.freedoms != self.freedoms:
                return
            turned = way * float(moved.angles[slot] - here.angles[slot])
            if turned < LEAST_PROGRESS * TURN_STEP:
                return
            yield moved, turned
            here = moved


def _derivatives(tangent: Tangent) -> np.ndarray:
    """Return the derivatives (k, f) of the angles of springs by the coordinates y."""
    model = tangent.model
    return angle_derivatives(tangent, model.data.loads.angle[sprung(model)].astype(int))


def _soft_springs(tangent: Tangent) -> np.ndarray:
    """Return the springs (k,) that the forces on the bodies may hold at half a turn."""
    rows, loads = _derivatives(tangent), tangent.model.data.loads
    held = np.abs(rows) @ tangent.pushes
    wound = np.pi * loads.stiffness[sprung(tangent.model)] * (rows**2).sum(axis=1) / tangent.mass
    return np.flatnonzero(wound < SOFT * held)


def _may_vanish(first: float, middle: float, last: float) -> bool:
    """Return whether the parabola through three equally spaced values of one sign reaches zero near the
    middle one."""
    bend, slope = first - 2 * middle + last, (last - first) / 2
    if not abs(middle) < min(abs(first), abs(last)):
        return False
    return middle * (middle - slope**2 / (2 * bend)) <= 0.1 * middle**2
