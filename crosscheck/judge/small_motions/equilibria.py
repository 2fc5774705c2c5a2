"""Search for steady poses: Newton's method with damping on joint coordinates, from several starts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.constraints import closure, scene_length
from crosscheck.judge.deadline import ask
from crosscheck.judge.small_motions.equations import STEP, Balance, NotSteady, Small, in_doubles
from crosscheck.judge.small_motions.error_bounds import error_bounds
from crosscheck.judge.small_motions.turning import turning
from crosscheck.judge.tolerances import NEXT_TO_SINGULAR
from mbref import rotations
from mbref.scene import Scene, SceneError

STARTS = 16  # number of poses from which a steady pose is searched
SEED = 20  # of the random starts
NEAR, FAR = 0.5, 3.0  # rad or lengths; sizes of the displacements of the starts
ITERATIONS = 60  # of Newton's method from a start
MOST_DAMPED = 1e6  # damping / squared stiffness at which a search ends
STRIDE, STRIDES = 0.4, 6  # rad or lengths, and number of starts along the constraints in each direction
LONGEST = 0.4  # rad or lengths; longest Newton step
BALANCED = 1e-10  # unbalanced force / largest force at the starts, of a pose in double precision
REFINED = 1e-15  # the same after refinement in long doubles
REFINEMENTS = 6
# distance to a steady pose, lengths or rad, above which the change of the small motions up to there counts
UNDETERMINED = 1e-9
ASSEMBLED = 1e-8  # largest residual of a joint, m or rad
SAME = 1e-6  # rad or lengths; distance below which two poses count as one
LINKS = 40  # largest number of poses that are tested between two steady poses
UNSTEADY = 1e-8  # change of the matrices / largest entry after a rotation; above, the motion is not steady
ROTATED = 1.0  # rad; rotation after which the matrices are compared
# change of the stiffness with the increment of differences / largest entry, above which the increment is too
# long; rad or lengths, an increment that is not shortened
LONG_STEP, SHORTEST_STEP = 1e-8, 1e-5
SMALLEST = 4e-16  # relative uncertainty of eigenvalues of matrices in double precision


@dataclass(frozen=True)
class Steady:
    """A steady pose by the judge: rest, or relative rest in a mechanism that turns with its driver.

    Attributes
    ----------
    position, orientation : ndarray, shape (nb, 3) and (nb, 4)
        Poses of the bodies; unit quaternions (w, x, y, z).
    eigenvalues : ndarray, shape (2f,), complex
        Exponents s, 1/s, slowest first.
    uncertainty : float
        Change of the eigenvalues / largest eigenvalue with twice the increment of the differences.
    bounds : ndarray, shape (2f,)
        Largest error of each eigenvalue, 1/s.
    balance, state, small
        The equations, the state (n,) of them, and the matrices of small motions.
    """

    position: np.ndarray
    orientation: np.ndarray
    eigenvalues: np.ndarray
    uncertainty: float
    bounds: np.ndarray
    balance: Balance
    state: np.ndarray
    small: Small

    @property
    def stability(self) -> str:
        """``stable``, ``unstable`` or ``indifferent``, by the real parts that exceed their bounds.

        mbref has a rule of its own (`mbref.Equilibrium.stability`), which this one judges.
        """
        if (self.eigenvalues.real > self.bounds).any():
            return "unstable"
        return "indifferent" if (np.abs(self.eigenvalues) <= self.bounds).any() else "stable"


def steady_poses(scene: Scene, starts: int = STARTS) -> list[Steady]:
    """Return the steady poses that are found from several starts, the scene's own pose first.

    Raises
    ------
    SceneError
        If the scene has no small motions: a body has no mass, a load varies, drivers move otherwise than by
        one constant rotation, or there is no degree of freedom.
    """
    motion = turning(scene)
    balance = Balance(scene, motion)
    try:
        first = balance.start()
    except NotSteady as reason:
        raise SceneError([f"{scene.name}: {reason}"]) from None
    if balance.basis(balance.at(first[None])).shape[1] == 0:
        raise SceneError(["the mechanism has no degree of freedom, so it rests at any load"])
    quick = in_doubles(balance)
    poses = list(_starts(quick, doubles(first), starts))
    scale = _scale(quick, poses)
    found: list[Steady] = []
    for pose in poses:
        settled = _settled(quick, pose, scale)
        if settled is None or any(_is_known(quick, settled, other, scale) for other in found):
            continue
        if (each := _steady(balance, settled, scale)) is not None:
            found.append(each)
    return found


def _scale(balance: Balance, poses: list[np.ndarray]) -> float:
    """Return the largest force (J) along a unit joint coordinate at some poses."""
    forces = [np.abs(balance.forces(balance.at(y[None]))[0] * balance.sizes).max() for y in poses]
    return max(forces, default=0.0)


def _starts(balance: Balance, first: np.ndarray, count: int) -> Iterator[np.ndarray]:
    """Yield the first pose, poses along the constraints from it, and random displacements with closed
    loops, with a fixed seed."""
    rng = np.random.default_rng(SEED)
    yield first
    if count > 1:
        direction = rng.uniform(-1, 1, balance.equations.nv)
        yield from _along(balance, first, direction)
        yield from _along(balance, first, -direction)
    for k in range(1, count):
        ask()
        size = (NEAR, FAR)[k % 2]
        step = size * balance.sizes * rng.uniform(-1, 1, balance.equations.nv)
        try:
            yield balance.steady(balance.closed(balance.moved(first, step[None])[0]))
        except NotSteady:
            continue


def _along(balance: Balance, y: np.ndarray, direction: np.ndarray) -> Iterator[np.ndarray]:
    """Yield poses along the constraints that follow a direction (nv,), in units of ``sizes``."""
    for _ in range(STRIDES):
        ask()
        basis = balance.basis(balance.at(y[None])) / balance.sizes[:, None]
        ahead = basis @ np.linalg.lstsq(basis, direction, rcond=None)[0]
        direction = ahead / (np.linalg.norm(ahead) or 1.0)
        try:
            y = balance.steady(
                balance.closed(balance.moved(y, (STRIDE * balance.sizes * direction)[None])[0])
            )
        except NotSteady:
            return
        yield y


def _settled(balance: Balance, y: np.ndarray, scale: float) -> np.ndarray | None:
    """Return the steady pose near a start by damped Newton steps; None if there is none."""
    damping, off = 0.0, balance.unbalanced(y)
    for _ in range(ITERATIONS):
        ask()
        if np.linalg.norm(off) <= BALANCED * scale:
            return y
        basis = balance.basis(balance.at(y[None]))
        slope = basis.T @ balance.stiffness(y, basis, STEP / 100, order=2)
        weight = damping * float(np.linalg.norm(slope)) ** 2
        step = np.linalg.lstsq(slope.T @ slope + weight * np.eye(len(off)), slope.T @ off, rcond=None)[0]
        if not step.any():  # the stiffness vanishes: follow the force
            step = off * LONGEST / np.linalg.norm(off)
        step /= max(1.0, float(np.linalg.norm(step)) / LONGEST)
        try:
            moved = balance.steady(balance.closed(balance.moved(y, (basis @ step)[None])[0]))
            after = balance.unbalanced(moved)
        except (NotSteady, np.linalg.LinAlgError):
            moved, after = y, off
        if len(after) != len(off) or not np.linalg.norm(after) < np.linalg.norm(off):
            damping = max(10 * damping, 1e-3)
            if damping > MOST_DAMPED:
                return None
            continue
        y, off, damping = moved, after, damping / 10
    return None


def _steady(balance: Balance, y: np.ndarray, scale: float) -> Steady | None:
    """Return the pose refined in long doubles, with its small motions; None if it is not steady or is
    singular."""
    y = balance.arithmetic.array(y)
    for _ in range(REFINEMENTS):
        y = balance.steady(balance.closed(y))
        basis = balance.basis(balance.at(y[None]))
        off = basis.T @ balance.forces(balance.at(y[None]))[0]
        if np.abs(doubles(off)).max() <= REFINED * scale:
            break
        slope = doubles(basis.T @ balance.stiffness(y, basis, STEP))
        step = basis @ np.linalg.lstsq(slope, doubles(off), rcond=None)[0]
        y = balance.moved(y, step[None])[0]
    y = balance.steady(balance.closed(y))
    if not _is_assembled(balance, y):
        return None
    if not _moves_on(balance, y, doubles(basis)):
        return None
    small, coarse = _small_motions(balance, y)
    eigenvalues = small.eigenvalues()
    size = float(np.abs(eigenvalues).max(initial=0.0)) or 1.0
    change = float(np.abs(coarse.eigenvalues() - eigenvalues).max()) / size
    if balance.conditioning(y) < NEXT_TO_SINGULAR or (balance.motion.rate and not _stays(balance, y, small)):
        return None
    others = [coarse, *_beside(balance, y, small)]
    bounds = error_bounds(small, others)
    return Steady(*balance.poses(y), eigenvalues, max(change, SMALLEST), bounds, balance, y, small)


def _small_motions(balance: Balance, y: np.ndarray) -> tuple[Small, Small]:
    """Return the small motions about a steady state, and the ones by twice the increment of differences.

    Both are shortened until they agree, as for a spring that is far shorter than the mechanism.
    """
    step = STEP
    while True:
        small, coarse = balance.small(y, step), balance.small(y, 2 * step)
        change = np.abs(small.stiffness - coarse.stiffness).max(initial=0.0)
        if change <= LONG_STEP * np.abs(small.stiffness).max(initial=0.0) or step < SHORTEST_STEP:
            return small, coarse
        step /= 10


def _beside(balance: Balance, y: np.ndarray, small: Small) -> list[Small]:
    """Return the small motions as far from the state as the steady state may be: where stiffness vanishes,
    forces do not determine the pose."""
    off = small.basis.T @ doubles(balance.forces(balance.at(y[None]))[0])
    step = np.linalg.lstsq(small.stiffness, off, rcond=SMALLEST)[0]
    size = float(np.abs(small.basis @ step / balance.sizes).max(initial=0.0))
    if size < UNDETERMINED:
        return []
    share = 3 * min(1.0, STEP / (3 * size))
    moved = balance.moved(y, balance.arithmetic.array((small.basis @ (share * step))[None]))[0]
    try:
        return [balance.small(balance.steady(balance.closed(moved)), small.step)]
    except NotSteady:
        return []


def _moves_on(balance: Balance, y: np.ndarray, basis: np.ndarray) -> bool:
    """Return whether the joints hold at poses along the columns of a basis (nv, f) and along their sum.

    At a singular position displacements that the rows allow are of no motion.
    """
    for way in (*basis.T, basis.sum(axis=1)):
        step = balance.arithmetic.array(STEP / np.abs(way / balance.sizes).max() * way)
        try:
            there = balance.closed(balance.moved(y, step[None])[0])
        except NotSteady:
            return False
        if not _is_assembled(balance, there):
            return False
    return True


def _is_assembled(balance: Balance, y: np.ndarray) -> bool:
    """Return whether joints hold at a state: closures of perpendicular directions admit bodies that are
    turned by half a turn."""
    rows = closure(balance.scene, 0.0, *balance.poses(y)).values()
    return max((float(np.abs(each).max(initial=0.0)) for each in rows), default=0.0) < ASSEMBLED


def _stays(balance: Balance, y: np.ndarray, small: Small) -> bool:
    """Return whether the small motions are equal after the mechanism has turned by an angle."""
    later, n = y.copy(), balance.equations.tree.scalars
    rates = y[balance.equations.ends[2] :]
    later[:n] = later[:n] + ROTATED / balance.motion.rate * rates[:n]
    other, basis = balance.at(later[None]), balance.arithmetic.array(small.basis)
    mass = balance.equations.loads.mass_matrix(other.placed, other.coordinates)[0]
    parts = mass @ basis, balance.damping(later, basis, STEP), balance.stiffness(later, basis, STEP)
    found = [doubles(basis.T @ part) for part in parts]
    rate, heavy = balance.motion.rate, float(np.abs(small.mass).max())
    scales = heavy, heavy * rate, max(heavy * rate**2, float(np.abs(small.stiffness).max()))
    before = small.mass, small.damping, small.stiffness
    change = max(np.abs(found[k] - before[k]).max() / scales[k] for k in range(3))
    off = np.abs(doubles(basis.T @ balance.forces(other)[0])).max()
    return bool(max(change, off / (heavy * rate**2)) < UNSTEADY)


def _is_known(balance: Balance, pose: np.ndarray, other: Steady, scale: float) -> bool:
    """Return whether two steady poses are one, also if they differ by a rotation of the whole mechanism.

    Poses are one if the poses between them are steady, too.
    """
    position, orientation = balance.poses(pose)
    length = scene_length(balance.scene)
    apart = np.abs(position - other.position).max() / length
    angle = float(rotations.angle_between(orientation, other.orientation).max())
    return bool(max(apart, angle) < SAME) or _are_linked(balance, doubles(other.state), pose, scale)


def _are_linked(balance: Balance, y: np.ndarray, end: np.ndarray, scale: float) -> bool:
    """Return whether poses from one to another, along the joint coordinates, are steady."""
    step = balance.between(y, end)
    size = float(np.abs(step / balance.sizes).max(initial=0.0))
    count = min(LINKS, int(size / STRIDE) + 2)
    for share in np.linspace(0.0, 1.0, count + 1)[1:]:
        try:
            there = balance.steady(balance.closed(balance.moved(y, (share * step)[None])[0]))
        except NotSteady:
            return False
        if not np.linalg.norm(balance.unbalanced(there)) <= BALANCED * scale:
            return False
    return True
