"""Search for poses at which nothing accelerates: Newton's method, scaled by the tangent stiffness.

With the singular values σ and vectors u, v of A = ∂y''/∂y, a Newton step moves -uᵀ y'' / σ along v.  Steps
are compared by these displacements instead of accelerations, so that stiff springs do not hide soft motions
(the natural level function of P. Deuflhard, Newton Methods for Nonlinear Problems, 2004).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbref.design.joint_angles import sprung
from mbref.design.linearisation import EPSILON, OffConstraints, Tangent, norms_by_body

STRIDE = 0.35  # distance of neighbouring starts / length of the mechanism, or rad
LONGEST_STEP = 0.3  # largest step of a body towards an equilibrium / length of the mechanism, or rad
MOST_NEWTON_STEPS = 60  # largest number of Newton steps from a start
STEP_SHARES = (1.0, 0.5, 0.25, 0.1, 0.02)  # of a Newton step that are tried
# largest acceleration at an equilibrium / acceleration that the forces on the bodies give without cancelling
BALANCED = 1e-11
BALANCE_ROUNDING = 1e-15  # the same for accelerations that are rounding alone
PLACED = 64.0 * EPSILON  # rounding of a pose / length: stiff springs accelerate by it
LEAST_GAIN = 0.01  # least relative decrease of the displacement by a whole step, which may be a limited one
REFINED = 0.9  # largest ratio of displacements of successive refinements
UNDECIDED = 1e-4  # largest distance that is tried of an equilibrium without stiffness / length, or rad
ONE_POSE = 1e-6  # distance / length, or rad, below which two poses are one
NEAR = 0.1  # distance / length, or rad, below which a Newton step may lead to a known equilibrium
MISSED = 0.1  # distance from it at the end of this step / distance at its start
LINKS = 40  # largest number of steps between two poses of one family
STIFF = 0.05  # displacement by the forces / length, or rad, below which a direction is stiff
MOST_RETURNS = 12  # largest number of steps along stiff directions from a displaced pose


class Newton:
    """The Newton step at a pose: directions v and sizes of the tangent stiffness, and what is unbalanced."""

    def __init__(self, tangent: Tangent):
        self.tangent, self.off = tangent, tangent.off_balance()
        self.left, self.stiffness, right = np.linalg.svd(tangent.slope())
        self.directions = right.T
        moves = tangent.basis @ self.directions
        self.sizes = np.linalg.norm(moves, axis=0)
        # largest steps (f,): LONGEST_STEP of a body
        self.longest = LONGEST_STEP / norms_by_body(moves).max(axis=0)
        pushes = self._pushes(tangent.forces)
        # rounding of a pose accelerates stiff directions, rounding of all forces those without stiffness
        largest = PLACED * pushes.max(initial=0.0)
        is_flat = self.stiffness * UNDECIDED / self.sizes <= largest
        placed = PLACED * self.stiffness / self.sizes + np.where(is_flat, largest, 0.0)
        self.bound, self.rounding = BALANCED * pushes + placed, BALANCE_ROUNDING * pushes + placed / 16
        # directions (f,) along which nothing acts, such as the spin of a rod between ball joints
        self.is_idle = is_flat & (np.abs(self.parts(self.off)) <= self.bound)

    def parts(self, off: np.ndarray) -> np.ndarray:
        """Return the accelerations (f,) along u of x'' (n,)."""
        return np.asarray(self.left.T @ self.tangent.coordinates(off))

    @property
    def is_balanced(self) -> bool:
        """True at an equilibrium."""
        return bool((np.abs(self.parts(self.off)) <= self.bound).all())

    @property
    def _least_stiffness(self) -> np.ndarray:
        """Sizes σ (f,) of the stiffness, not less than the accelerations at the pose over the largest
        steps."""
        least = np.maximum(np.abs(self.parts(self.off)), self._negligible) / self.longest
        return np.maximum(np.maximum(self.stiffness, least), 1e-300)

    @property
    def _negligible(self) -> np.ndarray:
        """Accelerations (f,) that no step reduces: those in balance, or rounding if all are in balance."""
        return self.rounding if self.is_balanced else self.bound

    def step(self) -> np.ndarray:
        """Return the Newton step y (f,): at most LONGEST_STEP of a body along each direction."""
        return np.asarray(self.directions @ -self._displacements(self.off))

    def fall(self) -> np.ndarray:
        """Return the step y (f,) with the accelerations, over the sizes of the stiffness."""
        parts = self.directions.T @ self.tangent.coordinates(self.off)
        parts = np.where(np.abs(parts) <= self.bound, 0.0, parts)
        held = np.maximum(self.stiffness, np.abs(parts) / self.longest)
        return np.asarray(self.directions @ (parts / np.maximum(held, 1e-300)))

    @property
    def most_unstable(self) -> np.ndarray | None:
        """Direction y (f,) along which an equilibrium is left first, by a length or rad; None if it is
        stable."""
        is_left = ((self.left * self.directions).sum(axis=0) > 0.0) & self._leaves_balance
        k = int(np.argmax(is_left))  # stiffnesses descend
        return np.asarray(self.directions[:, k] / self.sizes[k]) if is_left.any() else None

    def level(self, off: np.ndarray) -> float:
        """Return the size of x'' (n,) as a displacement, lengths or rad, by the stiffness of this pose."""
        return float(np.linalg.norm(self._displacements(off) * self.sizes))

    def _displacements(self, off: np.ndarray) -> np.ndarray:
        """Return the displacements (f,) by x'' (n,) over the stiffness; 0 where it is negligible."""
        parts = self.parts(off)
        return np.where(np.abs(parts) <= self._negligible, 0.0, parts / self._least_stiffness)

    def moved(self, y: np.ndarray) -> Tangent | None:
        """Return the tangent at q(y), after a return to the balance of stiff directions; None if no pose on
        the constraints is found.

        A long step along a soft direction leaves this balance by its curvature, as it leaves the constraints.
        """
        moved, before = self.tangent.moved(y), float(np.linalg.norm(self.tangent.basis @ y))
        if moved is None or not self.is_stiff.any() or moved.freedoms != self.tangent.freedoms:
            return moved
        try:
            near = Newton(moved)
        except OffConstraints:
            return moved
        is_stiff = near.is_stiff_against(self.tangent.forces)
        for _ in range(MOST_RETURNS):
            parts = near.parts(moved.off_balance())
            moves = -np.where(is_stiff, parts, 0.0) / np.where(is_stiff, near.stiffness, 1.0)
            size = float(np.linalg.norm(moves * near.sizes))
            if not PLACED < size < REFINED * before:
                return moved
            back = moved.moved(moved.coordinates(near.tangent.basis @ (near.directions @ moves)))
            if back is None or back.freedoms != moved.freedoms:
                return moved
            moved, before = back, size
        return moved

    @property
    def is_stiff(self) -> np.ndarray:
        """Directions (f,) along which the forces on the bodies give a small displacement."""
        return self.is_stiff_against(self.tangent.forces)

    def is_stiff_against(self, forces: np.ndarray) -> np.ndarray:
        """Return the directions (f,) along which forces of sizes (2 nb,) give a small displacement."""
        return np.asarray(self._pushes(forces) * self.sizes < STIFF * self.stiffness)

    def _pushes(self, forces: np.ndarray) -> np.ndarray:
        """Return the accelerations (f,) along u that forces of sizes (2 nb,) give without cancelling."""
        return np.asarray(np.abs(self.left.T) @ self.tangent.pushes_of(forces))

    def softened(self, y: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return a direction y (f,) with less of each direction that a spring holds, and no idle one if
        others remain.

        Its part is the displacement by forces on the bodies, of sizes (2 nb,), over a stride, at most one.
        """
        free = np.maximum(self._pushes(forces) * self.sizes / STRIDE, self.stiffness.min(initial=np.inf))
        share = np.minimum(1.0, free / np.maximum(self.stiffness, 1e-300))
        share[self.is_idle & ~self.is_idle.all()] = 0.0
        return np.asarray(self.directions @ (share * (self.directions.T @ y)))

    def away(self) -> np.ndarray:
        """Return a displacement y (f,) as far as the equilibrium may be from the pose."""
        parts, most = np.maximum(np.abs(self.parts(self.off)), self.rounding), UNDECIDED / self.sizes
        moves = np.minimum(parts / np.maximum(self.stiffness, 1e-300), most)
        moves = np.where(self._leaves_balance, moves, most)
        return np.asarray(self.directions @ np.where(moves * self.sizes > ONE_POSE**1.5, moves, 0.0))

    @property
    def _leaves_balance(self) -> np.ndarray:
        """Directions (f,) along which a displacement by UNDECIDED leaves the balance."""
        return np.asarray(self.stiffness * UNDECIDED / self.sizes > self.bound)

    def leads_to(self, other: Newton) -> bool:
        """Return whether the Newton step ends near an isolated equilibrium; a marginal one is approached by
        half of the way only."""
        if self.tangent.freedoms != other.tangent.freedoms or not other.is_isolated:
            return False
        apart = self.tangent.to(other.tangent)
        distance = float(np.linalg.norm(apart))
        if distance > NEAR or _turned(self, other) > np.pi:
            return False
        missed = float(np.linalg.norm(self.tangent.basis @ self.step() - apart))
        return distance < ONE_POSE or missed < MISSED * distance

    @property
    def is_isolated(self) -> bool:
        """True if every displacement by UNDECIDED leaves the balance."""
        return bool(self._leaves_balance.all())


def balanced(tangent: Tangent, freedoms: int, known: Sequence[Newton]) -> Newton | None:
    """Return the equilibrium that Newton's method reaches from a pose, refined; None if there is none.

    A ``known`` equilibrium is returned as soon as a Newton step leads to it.
    """
    try:
        here = Newton(tangent)
        for _ in range(MOST_NEWTON_STEPS):
            for other in known:
                if here.leads_to(other):
                    return other
            if here.is_balanced:
                return _refined(here, freedoms)
            ahead = _damped_step(here, freedoms)
            if ahead is None:
                return None
            if ahead.freedoms != freedoms:  # a singular position
                found = Newton(ahead)
                return found if found.is_balanced else None
            here = Newton(ahead)
    except OffConstraints:
        pass
    return None


def _damped_step(here: Newton, freedoms: int) -> Tangent | None:
    """Return the pose after a share of the Newton step that brings the balance nearer."""
    step, level = here.step(), here.level(here.off)
    for share in STEP_SHARES:
        moved = here.moved(share * step)
        if moved is not None and here.level(moved.off_balance()) < (1 - LEAST_GAIN * share) * level:
            return moved
    return None


def _refined(here: Newton, freedoms: int) -> Newton:
    """Return the equilibrium after Newton steps that still bring it nearer."""
    for _ in range(MOST_NEWTON_STEPS):
        moved = here.tangent.moved(here.step())
        if moved is None or moved.freedoms != freedoms:
            return here
        if not here.level(moved.off_balance()) < REFINED * here.level(here.off):
            return here
        try:
            here = Newton(moved)
        except OffConstraints:
            return here
    return here


def are_one(first: Newton, second: Newton) -> bool:
    """Return whether poses between two equilibria are equilibria too, so that both belong to one family."""
    if _turned(first, second) > np.pi:
        return False
    here, target, before = first.tangent, second.tangent, np.inf
    for _ in range(LINKS):
        apart = here.to(target)
        distance = float(np.abs(apart).max(initial=0.0))
        if distance < ONE_POSE:
            return True
        if first.is_isolated or not distance < before:
            return False
        y = here.coordinates(apart)
        size = float(np.linalg.norm(here.basis @ y)) or 1.0
        moved = here.moved(min(1.0, STRIDE / size) * y)
        if moved is None or moved.freedoms != here.freedoms or not _is_equilibrium(moved, first):
            return False
        here, before = moved, distance
    return False


def _turned(first: Newton, second: Newton) -> float:
    """Return the largest difference of angles, rad, of torsion springs between two poses; full turns of other
    joints leave a pose as it is."""
    model = first.tangent.model
    sprung_angles = model.data.loads.angle[sprung(model)].astype(int)
    return float(np.abs((first.tangent.angles - second.tangent.angles)[sprung_angles]).max(initial=0.0))


def _is_equilibrium(tangent: Tangent, near: Newton) -> bool:
    """Return whether nothing accelerates at a pose, by the bounds of an equilibrium."""
    parts = np.abs(tangent.coordinates(tangent.off_balance()))
    return bool((parts <= BALANCED * tangent.pushes + near.bound.max(initial=0.0)).all())
