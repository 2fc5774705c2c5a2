"""Errors of an engine's derivatives of accelerations, at states of a mechanism.

On the constraints the truth are the judge's derivatives along motions that the joints allow, whatever the
engine's coordinates are: its derivatives are taken along δq with W δq = N and along the δv of the judge's
rule. There and off the constraints, where loops are open, the other truth are differences of the engine's
own accelerations, of which each coordinate is displaced alone. They are left out for loops whose rank grows
off the constraints.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from crosscheck.derivatives.without import reason
from crosscheck.differentiating import Differentiating, OwnDerivatives, TangentDerivatives
from crosscheck.engine import Cannot, Engine, Owner
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.small_motions.equations import CENTRAL
from crosscheck.judge.state_derivatives import StateDerivatives, bounded_derivatives, number_at
from mbref.scene import Scene, intermittent

MOVING, AT_REST, OPEN = "moving", "at rest", "open loops"
JUDGE, OWN = "judge", "own differences"
BLOCKS = POSITION, VELOCITY, FORCE, NUMBER = "position", "velocity", "force", "number"
RIGHT, ROUGH, WRONG, UNDECIDED = "right", "rough", "wrong", "undecided"
MOST = {RIGHT: 1e-6, ROUGH: 1e-2, WRONG: np.inf}  # relative error of derivatives of a grade
SAFETY = 3.0  # factor on the uncertainty of the truth, below which an error proves nothing
STEP = 2e-3  # of differences of order 8 of kinematics, rad or lengths of the mechanism
FINER = 10.0  # of differences of accelerations, of whose steps the two that agree best are taken
STEPS = (2e-3, 2e-4, 2e-5, 2e-6)
# rad/s, or lengths of the mechanism over s: step of differences by velocities, which are quadratic
FAST = 1.0
OPENED = 0.02  # displacement, rad or lengths, that opens loops
SAME = 1e-8  # part of the twists that an engine's coordinates may miss
Source = tuple[str, str, str, str, str]  # engine, version, function, scene, state of a Row
STILL = {"velocity": None, "angular_velocity": None}


@dataclass(frozen=True)
class Row:
    """The error of one block of derivatives, by an engine's function at a state, relative to the block's
    largest entry, or to what moves a body by its displacement in the scene's duration; infinite where a
    derivative is not finite.

    ``worst`` is the coordinate, or the component of a body's acceleration, that is most off. ``uncertain`` is
    the error of the truth, too large where the engine's accelerations have a kink.
    """

    engine: str
    version: str
    function: str
    scene: str
    state: str
    truth: str
    by: str
    error: float
    worst: str
    uncertain: float = 0.0

    @property
    def grade(self) -> str:
        """Return ``right``, ``rough``, ``wrong``, or ``undecided`` where the truth is too uncertain."""
        found = next((name for name, most in MOST.items() if self.error <= most), WRONG)
        return UNDECIDED if found != RIGHT and self.error <= SAFETY * self.uncertain else found


def refusal(engine: Engine, scene: Scene) -> Cannot | None:
    """Return the reason why an engine's derivatives are not compared on a scene, if there is one."""
    if not isinstance(engine, Differentiating):
        return reason(engine.name)
    if scene.driver or any(intermittent(scene)):
        return Cannot(Owner.ADAPTER, "derivatives are compared without drivers, intervals and end stops")
    return engine.cannot(scene)


def rows(engine: Engine, scene: Scene) -> Iterator[Row]:
    """Yield the errors of all functions of an engine on a scene without its loads, which adapters compute.

    Raises NotSmooth at a singular position.
    """
    assert isinstance(engine, Differentiating)
    bare, numbers = scene.with_(load=[]), numbers_of(scene)
    still = bare.with_(body=[body.model_copy(update=STILL) for body in bare.body])
    states = {AT_REST: (still, bounded_derivatives(still, numbers).values)}
    true = bounded_derivatives(bare, numbers).values
    if np.abs(true.by_velocity).max(initial=0.0) > 0.0 and any(
        b.velocity or b.angular_velocity for b in scene.body
    ):
        states = {MOVING: (bare, true), **states}
    for function in engine.differentiates_by:
        found = {state: engine.own_derivatives(at, function) for state, (at, _) in states.items()}
        source = (engine.name, engine.version(), function, bare.name)
        for state, (at, judged) in states.items():
            yield from _at(found[state], (*source, state), at, judged)
            by_number = engine.own_number_derivatives(at, function, numbers)
            if by_number is not None:
                sizes = np.array([abs(number_at(at, number)) for number in numbers])
                least = float(np.abs(judged.by_position).max(initial=at.duration**-2.0))
                error, worst, _ = _error(by_number * sizes, judged.by_number * sizes, _components(at), least)
                yield Row(*source, state, JUDGE, NUMBER, error, worst)
        first = next(iter(states))
        if isinstance(own := found[first], OwnDerivatives):
            yield from _open(engine, own, (*source, OPEN), states[first][0])


def numbers_of(scene: Scene) -> list[str]:
    """Return paths of the numbers by which derivatives are compared: masses, and gravity that is not zero."""
    pulls = [f"gravity.{axis}" for axis, value in zip("xyz", scene.gravity, strict=True) if value]
    return [*(f"body[{body.name}].mass" for body in scene.body if body.mass), *pulls]


def _at(
    found: OwnDerivatives | TangentDerivatives, source: Source, scene: Scene, judged: StateDerivatives
) -> Iterator[Row]:
    """Yield the errors at a state on the constraints."""
    named = _components(scene)
    if isinstance(found, OwnDerivatives):
        tangent = along_constraints(found, judged, scene)
    else:
        turned = np.linalg.lstsq(found.basis, judged.basis, rcond=None)[0]
        tangent = TangentDerivatives(
            judged.basis, found.by_position @ turned, found.by_velocity @ turned, found.by_force
        )
    slow = 1 / scene.duration
    size = float(np.abs(judged.by_position).max(initial=slow**2)) ** 0.5
    for by, own, true, least in (
        (POSITION, tangent.by_position, judged.by_position, slow**2),
        (VELOCITY, tangent.by_velocity, judged.by_velocity, size),
        (FORCE, tangent.by_force, judged.by_force, 0.0),
    ):
        if own is not None:
            yield Row(*source, JUDGE, by, *_error(own, true, named, least)[:2])
    if isinstance(found, OwnDerivatives) and _is_smooth(found, scene):
        yield from _by_differences(found, source, scene)


def _open(engine: Differentiating, found: OwnDerivatives, source: Source, scene: Scene) -> Iterator[Row]:
    """Yield the errors against the engine's own accelerations, with loops opened from a state."""
    if not _is_smooth(found, scene):
        return
    opened = engine.own_derivatives(scene, source[2], _away(found, scene))
    assert isinstance(opened, OwnDerivatives)
    yield from _by_differences(opened, source, scene)


def _away(found: OwnDerivatives, scene: Scene) -> np.ndarray:
    """Return a displacement (nv,) of all coordinates, which opens loops."""
    return OPENED * np.random.default_rng(0).uniform(-1, 1, len(found.velocity)) * _sizes(found, scene)


def _is_smooth(found: OwnDerivatives, scene: Scene) -> bool:
    """Return whether the closures have the same rank with open loops. If redundant rows become independent
    there, as of Bennett's linkage, accelerations off the constraints depend on the solver, with a jump."""
    sizes, unit = _sizes(found, scene), np.eye(len(found.velocity))
    ranks = []
    for place in (0 * found.velocity, _away(found, scene)):
        rows = np.array([found.opening(place, sizes * e) for e in unit])
        values = np.linalg.svd(rows, compute_uv=False) if rows.size else np.zeros(0)
        ranks.append(int(np.sum(values > SAME * values.max(initial=0.0))))
    return ranks[0] == ranks[1]


def _by_differences(found: OwnDerivatives, source: Source, scene: Scene) -> Iterator[Row]:
    """Yield the errors against differences of the engine's own accelerations."""
    nothing, sizes = 0 * found.velocity, _sizes(found, scene)
    v, columns = found.velocity, np.eye(len(sizes))
    speed = FAST * max(1.0, float(np.abs(v / sizes).max(initial=0.0)))

    def slopes(function: Callable[[np.ndarray], np.ndarray], steps: np.ndarray) -> np.ndarray:
        """Return derivatives (nv, nv) of a function, one row for each coordinate, in the unit of steps."""
        rows = [derivative(function, h * e) for e, h in zip(columns, steps, strict=True)]
        return np.array(rows) / sizes

    ways = {
        POSITION: (found.by_position, lambda x: found.own(x, v, nothing), STEPS, sizes),
        VELOCITY: (found.by_velocity, lambda x: found.own(nothing, v + x, nothing), (speed,), sizes),
        FORCE: (found.by_force, lambda x: found.own(nothing, v, x), (1.0,), 1 / sizes),
    }
    size = scene.duration**-2.0
    for name, (own, function, steps, units) in ways.items():
        if own is None:
            continue
        many = [slopes(function, step * units) / step for step in (*steps, steps[-1] / FINER)]
        changes = [finite_or_infinite(np.abs(a - b)) for a, b in itertools.pairwise(many)]
        apart = [float(change.max(initial=0.0)) for change in changes]
        best = int(np.argmin(apart))
        least = {POSITION: size, VELOCITY: size**0.5}.get(name, 0.0)
        error, worst, scale = _error(
            (own * units / sizes[:, None]).T, many[best + 1], found.coordinates, least
        )
        yield Row(*source, OWN, name, error, worst, apart[best] / scale)
        size = scale if name == POSITION else size


class Allowed(Protocol):
    """Allowed displacements (6 nb, f), and the changes of twists (6 nb, f) along them."""

    @property
    def basis(self) -> np.ndarray: ...

    @property
    def carried(self) -> np.ndarray: ...


def own_rows(
    engine: Differentiating, found: OwnDerivatives, source: tuple[str, str, str, str], scene: Scene
) -> Iterator[Row]:
    """Yield the errors against differences of the engine's own accelerations, with closed and open loops."""
    if _is_smooth(found, scene):
        yield from _by_differences(found, (*source, MOVING), scene)
    yield from _open(engine, found, (*source, OPEN), scene)


def along_constraints(found: OwnDerivatives, judged: Allowed, scene: Scene) -> TangentDerivatives:
    """Return an engine's derivatives along allowed motions, by the judge's rule.

    Raises ValueError if the engine's coordinates cannot move as the joints allow.
    """
    nothing, v, a = 0 * found.velocity, found.velocity, found.acceleration
    sizes, twists = _sizes(found, scene), _twists(found)
    closing, spinning = (
        np.array([f(nothing, e) for e in np.eye(len(v))]).T for f in (found.opening, found.spins)
    )
    # largest rate of a closure is one, so that engines may scale their rows
    largest = np.abs(closing).max(initial=0.0) or 1.0
    whole = np.concatenate([twists, closing / largest, spinning])

    def solved(twist: np.ndarray, opening: np.ndarray, spin: np.ndarray) -> np.ndarray:
        wanted = np.concatenate([twist, opening / largest, spin])
        rates = np.linalg.lstsq(whole * sizes, wanted, rcond=SAME)[0] * sizes
        if np.abs(whole @ rates - wanted).max(initial=0.0) > SAME * np.abs(wanted).max(initial=1.0):
            raise ValueError(f"{scene.name}: the engine's coordinates do not move as the joints allow")
        return np.asarray(rates)

    def step(place: np.ndarray) -> float:
        return STEP / float(np.abs(place / sizes).max(initial=0.0)) if place.any() else 1.0

    def kinematics(place: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return the changes (2, 6 nb) of twists and accelerations along a displacement and a rate."""
        h = step(place)
        return (
            derivative(lambda s: np.array(found.bodies(s[0], v + s[1], a)), h * np.array([place, rate])) / h
        )

    still = 0 * closing[:, 0], 0 * spinning[:, 0]
    moves = np.array([solved(twist, *still) for twist in judged.basis.T]).reshape(-1, len(v)).T
    columns = []
    for place, carried in zip(moves.T, judged.carried.T, strict=True):
        turned, h = kinematics(place, nothing)[0], step(place)
        opened = derivative(lambda x: found.opening(x, v), h * place) / h
        spun = derivative(lambda x: found.spins(x, v), h * place) / h
        rate = solved(carried - turned, -opened, -spun)
        own = found.by_position @ place + found.by_velocity @ rate
        columns.append(kinematics(place, rate)[1] + twists @ own)
    rated = [kinematics(nothing, rate)[1] + twists @ (found.by_velocity @ rate) for rate in moves.T]
    shape = judged.basis.shape
    return TangentDerivatives(
        judged.basis,
        np.array(columns).reshape(shape[::-1]).T,
        np.array(rated).reshape(shape[::-1]).T,
        None if found.by_force is None else twists @ found.by_force @ twists.T,
    )


def derivative(function: Callable[[np.ndarray], np.ndarray], step: np.ndarray) -> np.ndarray:
    """Return the change of a function along a step, to first order, by differences of order 8."""
    return np.asarray(sum(w * (function(k * step) - function(-k * step)) for k, w in CENTRAL))


def _twists(found: OwnDerivatives) -> np.ndarray:
    """Return the twists (6 nb, nv) for unit velocities."""
    nothing = 0 * found.velocity
    return np.array([found.bodies(nothing, e, nothing)[0] for e in np.eye(len(nothing))]).T


def _sizes(found: OwnDerivatives, scene: Scene) -> np.ndarray:
    """Return the size (nv,) of each coordinate: a length of the mechanism, or 1 rad."""
    turns = np.abs(_twists(found).reshape(-1, 2, 3, len(found.velocity))[:, 1]).max(axis=(0, 1)) > SAME
    return np.where(turns, 1.0, scene_length(scene))


def _error(
    own: np.ndarray, true: np.ndarray, named: tuple[str, ...], least: float
) -> tuple[float, str, float]:
    """Return the largest difference of rows / a scale, the largest true entry or ``least``, infinite where an
    entry is not finite; the row's name; and the scale."""
    off = finite_or_infinite(np.abs(own - true)).max(axis=1, initial=0.0)
    largest = float(np.abs(true).max(initial=0.0, where=np.isfinite(true)))
    scale = max(largest, least, np.finfo(float).tiny)
    return float(off.max(initial=0.0)) / scale, named[int(off.argmax())], scale


def finite_or_infinite(sizes: np.ndarray) -> np.ndarray:
    """Return sizes of errors with infinity in place of NaN, which no comparison finds large."""
    return np.where(np.isnan(sizes), np.inf, sizes)


def _components(scene: Scene) -> tuple[str, ...]:
    kinds = ("acceleration", "angular_acceleration")
    return tuple(f"{body.name}.{kind}.{axis}" for body in scene.body for kind in kinds for axis in "xyz")
