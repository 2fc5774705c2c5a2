"""Search for poses at which nothing accelerates: Newton's method, scaled by the tangent stiffness.

With the singular values σ and vectors u, v of A = ∂y''/∂y, a Newton step moves -uᵀ y'' / σ along v.  Steps
are compared by these displacements instead of accelerations, so that stiff springs do not hide soft motions
(the natural level function of P. Deuflhard, Newton Methods for Nonlinear Problems, 2004).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from mbref import rotations
from mbref.design.joint_angles import sprung
from mbref.design.linearisation import EPSILON, OffConstraints, Tangent

STRIDE = 0.35  # distance of neighbouring starts / length of the mechanism, or rad
LONGEST_STEP = 0.3  # largest step towards an equilibrium / length of the mechanism, or rad
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
LINKS = 40  # largest number of steps between two poses of one family
STIFF = 0.05  # displacement by the forces / length, or rad, below which a direction is stiff
MOST_RETURNS = 12  # largest number of steps along stiff directions from a displaced pose


class Newton:
    """The Newton step at a pose: directions v and sizes of the tangent stiffness, and what is unbalanced."""

    def __init__(self, tangent: Tangent):
        self.tangent, self.off = tangent, tangent.off_balance()
        self.left, self.stiffness, right = np.linalg.svd(tangent.slope())
        self.directions = right.T
        self.sizes = np.linalg.norm(tangent.basis @ self.directions, axis=0)
        pushes = np.abs(self.left.T) @ tangent.pushes
        placed = PLACED * self.stiffness / self.sizes
        self.bound, self.rounding = BALANCED * pushes + placed, BALANCE_ROUNDING * pushes + placed / 16
        # directions (f,) along which the forces on the bodies give a small displacement
        self.is_stiff = pushes * self.sizes < STIFF * self.stiffness

    def parts(self, off: np.ndarray) -> np.ndarray:
        """Return the accelerations (f,) along u of x'' (n,)."""
        return np.asarray(self.left.T @ self.tangent.coordinates(off))

    @property
    def is_balanced(self) -> bool:
        """True at an equilibrium."""
        return bool((np.abs(self.parts(self.off)) <= self.bound).all())

    def displacements(self, off: np.ndarray, longest: float) -> np.ndarray:
        """Return the displacements (f,) along v that balance x'' (n,), each shorter than a length or rad."""
        parts, most = self.parts(off), longest / self.sizes
        return np.asarray(
            np.sign(parts) * np.minimum(np.abs(parts) / np.maximum(self._least_stiffness(most), 1e-300), most)
        )

    def _least_stiffness(self, most: np.ndarray) -> np.ndarray:
        """Return σ (f,), not less than the accelerations at the pose over the largest displacements."""
        return np.maximum(self.stiffness, np.maximum(np.abs(self.parts(self.off)), self._negligible) / most)

    @property
    def _negligible(self) -> np.ndarray:
        """Accelerations (f,) that no step reduces: those in balance, or rounding if all are in balance."""
        return self.rounding if self.is_balanced else self.bound

    def step(self) -> np.ndarray:
        """Return the Newton step y (f,): at most LONGEST_STEP along each direction."""
        parts = self.parts(self.off)
        moves = -self.displacements(self.off, LONGEST_STEP)
        return np.asarray(self.directions @ np.where(np.abs(parts) <= self._negligible, 0.0, moves))

    def fall(self) -> np.ndarray:
        """Return the step y (f,) with the accelerations, over the sizes of the stiffness."""
        parts, most = self.directions.T @ self.tangent.coordinates(self.off), LONGEST_STEP / self.sizes
        parts = np.where(np.abs(parts) <= self.bound, 0.0, parts)
        held = np.maximum(self.stiffness, np.abs(parts) / most)
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
        held = self._least_stiffness(LONGEST_STEP / self.sizes)
        parts = np.abs(self.parts(off))
        return float(np.linalg.norm(parts / np.maximum(held, 1e-300) * self.sizes))

    def moved(self, y: np.ndarray) -> Tangent | None:
        """Return the tangent at q(y), after a return to the balance of stiff directions; None if no pose on
        the constraints is found.

        A long step along a soft direction leaves this balance by its curvature, as it leaves the constraints.
        """
        moved, is_stiff, before = self.tangent.moved(y), self.is_stiff, np.inf
        if moved is None or not is_stiff.any() or moved.freedoms != self.tangent.freedoms:
            return moved
        for _ in range(MOST_RETURNS):
            parts = self.parts(moved.off_balance())
            moves = -np.where(is_stiff, parts, 0.0) / np.where(is_stiff, self.stiffness, 1.0)
            size = float(np.linalg.norm(moves * self.sizes))
            if not PLACED < size < REFINED * before:
                return moved
            back = moved.moved(moved.coordinates(self.tangent.basis @ (self.directions @ moves)))
            if back is None or back.freedoms != moved.freedoms:
                return moved
            moved, before = back, size
        return moved

    def softened(self, y: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return a direction y (f,) with less of each direction that a spring holds.

        Its part is the displacement by forces on the bodies, of sizes (2 nb,), over a stride, at most one.
        """
        pushes = (np.abs(self.left.T) @ self.tangent.pushes_of(forces)) * self.sizes
        free = np.maximum(pushes / STRIDE, self.stiffness.min(initial=np.inf))
        share = np.minimum(1.0, free / np.maximum(self.stiffness, 1e-300))
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

    @property
    def is_isolated(self) -> bool:
        """True if every displacement by UNDECIDED leaves the balance."""
        return bool(self._leaves_balance.all())


def balanced(tangent: Tangent, freedoms: int) -> Newton | None:
    """Return the equilibrium that Newton's method reaches from a pose, refined; None if there is none."""
    try:
        here = Newton(tangent)
        for _ in range(MOST_NEWTON_STEPS):
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
    if np.abs(_spring_angles(first.tangent) - _spring_angles(second.tangent)).max(initial=0.0) > np.pi:
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


def _spring_angles(tangent: Tangent) -> np.ndarray:
    """Return the angles (k,), rad, of torsion springs; full turns of other joints leave a pose as it is."""
    model = tangent.model
    return np.asarray(tangent.angles[model.data.loads.angle[sprung(model)].astype(int)])


def _is_equilibrium(tangent: Tangent, near: Newton) -> bool:
    """Return whether nothing accelerates at a pose, by the bounds of an equilibrium."""
    parts = np.abs(tangent.coordinates(tangent.off_balance()))
    return bool((parts <= BALANCED * tangent.pushes + near.bound.max(initial=0.0)).all())


def starts_from(first: Tangent, freedoms: int, count: int) -> Iterator[Tangent]:
    """Yield the first pose, and further poses along the constraints in random directions with a fixed seed.

    Starts displace soft springs rather than stiff ones.
    """
    rng = np.random.default_rng(1)
    yield first
    ends = [first, first]
    directions: list[np.ndarray | None] = [None, None]
    for k in range(1, count):
        side = (k + 1) % 2
        tangent, old = ends[side], directions[side]
        drawn = rng.standard_normal(tangent.model.n)
        wish = drawn if old is None else old + 0.3 * rotations.unit(drawn)
        if old is None and side and directions[0] is not None:
            wish = -directions[0]
        direction, moved = _stride(tangent, tangent.basis.T @ wish, first.forces)
        if moved is None or moved.freedoms != freedoms:
            directions[side] = None
            continue
        directions[side], ends[side] = direction, moved
        yield moved


def _stride(tangent: Tangent, y: np.ndarray, forces: np.ndarray) -> tuple[np.ndarray, Tangent | None]:
    """Return a direction (n,) of unit length near y (f,) that displaces soft springs, and the pose after a
    stride along it."""
    here: Newton | Tangent = tangent
    with contextlib.suppress(OffConstraints):
        here = Newton(tangent)
        y = here.softened(y, forces)
    y = y / (np.linalg.norm(tangent.basis @ y) or 1.0)
    return rotations.unit(tangent.basis @ y), here.moved(STRIDE * y)
