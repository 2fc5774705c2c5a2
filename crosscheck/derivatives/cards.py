"""Cards that derivatives of an engine's accelerations must pass, whatever the judge's derivatives are.

A card is an identity: the closures of loops and the principle of virtual work hold at each neighbouring
state, accelerations change along the motion as their derivatives say, and a turned scene has turned
derivatives. The terms of the identities are the judge's at given states; its derivatives are not used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.changes.isometry import ASKEW, Isometry
from crosscheck.conformance.changes.relations import reordered
from crosscheck.conformance.changes.rewritings import duplicated
from crosscheck.conformance.changes.units import in_other_units
from crosscheck.derivatives import compare
from crosscheck.derivatives.mechanisms import COUPLED, FAST_LOOP, REDUNDANT, SPATIAL, Mechanism
from crosscheck.derivatives.neighbours import ORDERED, State, slope, tangent
from crosscheck.derivatives.without import reason
from crosscheck.differentiating import Differentiating, OwnDerivatives, TangentDerivatives
from crosscheck.engine import Engine
from crosscheck.judge.constraints import initial_twists
from crosscheck.judge.gauss_motion import gauss_motion
from mbref.scene import Scene

RIGHT = compare.MOST[compare.RIGHT]  # most relative error of a card of an engine in double precision
IN_ROUNDINGS = 1e4  # and of an engine in single precision, in its roundings
SHARE = 0.02  # of the time in which a body turns by 1 rad: step of differences along the motion
NO_FORCES = "the engine has no derivatives by forces; cards ask for the others"
LENGTH, TIME = 100.0, 10.0  # other units: centimetres and tenths of seconds


class NotAsked(Exception):
    """A card has nothing to compare; the argument is the reason."""


class Subject:
    """A function of an engine, and its derivatives on scenes."""

    def __init__(self, engine: Engine, function: str):
        assert isinstance(engine, Differentiating)
        self.engine, self.function, self.differentiating = engine, function, engine
        self._found: dict[Scene, OwnDerivatives | TangentDerivatives] = {}

    def found(self, scene: Scene) -> OwnDerivatives | TangentDerivatives:
        """Return the derivatives as the engine gives them."""
        if scene not in self._found:
            self._found[scene] = self.differentiating.own_derivatives(scene, self.function)
        return self._found[scene]

    def along(self, scene: Scene) -> TangentDerivatives:
        """Return the derivatives along the allowed displacements of ``tangent``."""
        found, allowed = self.found(scene), tangent(scene)
        if isinstance(found, OwnDerivatives):
            return compare.along_constraints(found, allowed, scene)
        turned = np.linalg.lstsq(found.basis, allowed.basis, rcond=None)[0]
        return TangentDerivatives(
            allowed.basis, found.by_position @ turned, found.by_velocity @ turned, found.by_force
        )


def _relative(off: np.ndarray, scale: float) -> float:
    """Return the largest error over a scale, infinite for NaN, which ``max`` of several errors would leave
    out."""
    found = np.abs(off) / max(scale, float(np.finfo(float).tiny))
    return float(compare.finite_or_infinite(found).max(initial=0.0))


def _neighbours(subject: Subject, scene: Scene) -> Iterator[tuple[Callable[[float], State], np.ndarray]]:
    """Yield states along each displacement u and rate u', and the derivative (6 nb,) of the accelerations."""
    state, (basis, carried), found = State(scene), tangent(scene), subject.along(scene)
    for place, rate, change in zip(basis.T, carried.T, found.by_position.T, strict=True):
        yield lambda s, p=place, r=rate: state.moved(s * p, s * r), change  # type: ignore[misc]
    for rate, change in zip(basis.T, found.by_velocity.T, strict=True):
        yield lambda s, r=rate: state.moved(0 * r, s * r), change  # type: ignore[misc]


def closures(subject: Subject, scene: Scene) -> float:
    """J a + J̇ v stays zero along displacements, velocities and forces."""
    state, found = State(scene), subject.along(scene)
    start, rows = state.acceleration(), np.abs(state.rows())
    errors = [0.0]
    for at, change in _neighbours(subject, scene):
        opening = slope(lambda s, at=at, c=change: at(s).closing(start + s * c))  # type: ignore[misc]
        errors.append(float(np.abs(opening).max(initial=0.0)))
    size = max(float((rows @ np.abs(part)).max(initial=0.0)) for part in (found.by_position, found.basis))
    most = _relative(np.array(errors), size)
    if found.by_force is not None and len(rows):
        size = float((rows @ np.abs(found.by_force)).max(initial=0.0))
        most = max(most, _relative(state.rows() @ found.by_force, size))
    return most


def virtual_work(subject: Subject, scene: Scene) -> float:
    """Forces of joints, M a - f, do no work along allowed displacements, at neighbouring states too; the
    derivatives by forces are symmetric."""
    state, found = State(scene), subject.along(scene)
    start, rows, basis = state.acceleration(), state.rows(), tangent(scene).basis
    joints = state.lacking(start)
    errors, sizes = [0.0], [float(np.abs(basis.T @ state.masses() @ basis).max(initial=0.0))]
    for at, change in _neighbours(subject, scene):
        pull = slope(lambda s, at=at, c=change: at(s).lacking(start + s * c))  # type: ignore[misc]
        turned = slope(lambda s, at=at: (at(s).rows() @ basis).ravel())  # type: ignore[misc]
        bent = -np.linalg.lstsq(rows, turned.reshape(len(rows), -1), rcond=ORDERED)[0]
        errors.append(float(np.abs(bent.T @ joints + basis.T @ pull).max(initial=0.0)))
        sizes.append(float((np.abs(basis.T) @ np.abs(state.masses()) @ np.abs(change)).max(initial=0.0)))
    most = _relative(np.array(errors), max(sizes))
    if (by_force := found.by_force) is not None:
        most = max(most, _relative(basis.T @ (state.masses() @ by_force) - basis.T, 1.0))
        most = max(most, _relative(by_force - by_force.T, float(np.abs(by_force).max(initial=0.0))))
    return most


def energy(subject: Subject, scene: Scene) -> float:
    """The power v·(M a - f) of the joints is zero at neighbouring states, so that the energy is constant."""
    state, found = State(scene), subject.along(scene)
    start, errors, size = state.acceleration(), [0.0], 0.0
    speed = np.abs(state.twist) @ np.abs(state.masses())
    for at, change in _neighbours(subject, scene):

        def power(s: float, at: Callable[[float], State] = at, change: np.ndarray = change) -> np.ndarray:
            now = at(s)
            return np.array([now.twist @ now.lacking(start + s * change)])

        errors.append(float(np.abs(slope(power)).max()))
        size = max(size, float(speed @ np.abs(change)))
    return _relative(np.array(errors), max(size, float((speed @ np.abs(found.basis)).max(initial=0.0))))


def chain_rule(subject: Subject, scene: Scene) -> float:
    """Along the motion, accelerations change by their derivatives times the rates of the state."""
    state, (basis, carried), found = State(scene), tangent(scene), subject.along(scene)
    spin, turning = (np.abs(x.reshape(-1, 6)[:, 3:]).max() for x in (state.twist, state.acceleration()))
    times = tuple(SHARE / float(max(spin, turning**0.5)) * k for k in range(1, 5))
    back = scene.with_(
        body=[body.model_copy(update=_reversed(scene, k)) for k, body in enumerate(scene.body)]
    )
    ahead, behind = (gauss_motion(each, times) for each in (scene, back))
    samples = [np.concatenate([m.acceleration, m.angular_acceleration], axis=2) for m in (ahead, behind)]
    off = (samples[0] - samples[1]).reshape(len(times), -1)
    jerk = sum(w * change for (_, w), change in zip(compare.CENTRAL, off, strict=True)) / times[0]
    rate = np.linalg.lstsq(basis, state.twist, rcond=None)[0]
    change = np.linalg.lstsq(basis, state.acceleration() - carried @ rate, rcond=None)[0]
    own = found.by_position @ rate + found.by_velocity @ change
    size = np.abs(found.by_position) @ np.abs(rate) + np.abs(found.by_velocity) @ np.abs(change)
    return _relative(own - jerk, float(max(size.max(initial=0.0), np.abs(jerk).max())))


def _reversed(scene: Scene, body: int) -> dict[str, tuple[float, ...]]:
    velocity, spin = (tuple(-part[body]) for part in initial_twists(scene))
    return {"velocity": velocity, "angular_velocity": spin}


def differences(subject: Subject, scene: Scene) -> float:
    """Differences of the engine's own accelerations with the best step equal the derivatives, with closed and
    with open loops."""
    found = subject.found(scene)
    if not isinstance(found, OwnDerivatives):
        raise NotAsked("the engine has derivatives along allowed motions only, and no accelerations off them")
    source = (subject.engine.name, subject.engine.version(), subject.function, scene.name)
    rows = [*compare.own_rows(subject.differentiating, found, source, scene)]
    errors = [row.error for row in rows if row.grade != compare.UNDECIDED]
    if not errors:
        raise NotAsked("the engine's own accelerations are not smooth near the state")
    return max(errors)


Change = tuple[Scene, np.ndarray, np.ndarray, np.ndarray, float]  # scene, (6 nb, 6 nb) of N, a, f; time


def _compared(subject: Subject, scene: Scene, changed: Change) -> float:
    """Return the difference of a changed scene's derivatives and the scene's, mapped to the changed one."""
    other, of_places, of_accelerations, of_forces, time = changed
    own, found = subject.along(scene), subject.along(other)
    back = np.linalg.inv(of_accelerations)
    turned = np.linalg.lstsq(found.basis, of_places @ own.basis, rcond=None)[0]
    most = 0.0
    size = float(np.abs(own.by_position).max(initial=0.0))
    least = size**0.5
    for a, b, factor, scale in (
        (own.by_position, found.by_position, 1.0, size),
        (
            own.by_velocity,
            found.by_velocity,
            1 / time,
            max(float(np.abs(own.by_velocity).max(initial=0.0)), least),
        ),
    ):
        most = max(most, _relative(back @ b @ turned * factor - a, scale))
    if own.by_force is not None and found.by_force is not None:
        size = float(np.abs(own.by_force).max(initial=0.0))
        most = max(most, _relative(back @ found.by_force @ of_forces - own.by_force, size))
    return most


def frame(subject: Subject, scene: Scene) -> float:
    """A scene turned as a whole has turned derivatives."""
    turn = np.kron(np.eye(2 * len(scene.body)), ASKEW)
    moved = Isometry(ASKEW, np.array([0.3, -0.5, 0.2])).change(_with_twists(scene))
    return _compared(subject, scene, (moved, turn, turn, turn, 1.0))


def order(subject: Subject, scene: Scene) -> float:
    """Bodies and joints in reverse order have the same derivatives."""
    swap = np.kron(np.eye(len(scene.body))[::-1], np.eye(6))
    return _compared(subject, scene, (reordered(scene), swap, swap, swap, 1.0))


def units(subject: Subject, scene: Scene) -> float:
    """Derivatives in centimetres and tenths of seconds are the same quantities."""
    n = len(scene.body)

    def factors(linear: float, angular: float) -> np.ndarray:
        return np.diag(np.tile(np.repeat([linear, angular], 3), n))

    other = in_other_units(_with_twists(scene), LENGTH, TIME)
    places, pushes = factors(LENGTH, 1.0), factors(LENGTH, 1.0) / TIME**2
    forces = factors(LENGTH, LENGTH**2) / TIME**2
    return _compared(subject, scene, (other, places, pushes, forces, TIME))


def redundant_rows(subject: Subject, scene: Scene) -> float:
    """A joint that is given twice changes no derivative."""
    twice, same = duplicated(scene), np.eye(6 * len(scene.body))
    assert not isinstance(twice, Outside)
    return _compared(subject, scene, (twice, same, same, same, 1.0))


def _with_twists(scene: Scene) -> Scene:
    velocity, spin = initial_twists(scene)
    bodies = [
        body.model_copy(update={"velocity": tuple(velocity[k]), "angular_velocity": tuple(spin[k])})
        for k, body in enumerate(scene.body)
    ]
    return scene.with_(body=bodies)


class Card(NamedTuple):
    """A card: the function, which returns a relative error, and its mechanisms."""

    check: Callable[[Subject, Scene], float]
    on: Sequence[Mechanism]

    @property
    def about(self) -> str:
        """Return the sentence on what must be true."""
        return " ".join((self.check.__doc__ or "").split())


CARDS = {
    "chain rule": Card(chain_rule, SPATIAL),
    "energy": Card(energy, SPATIAL),
    "virtual work": Card(virtual_work, SPATIAL),
    "closures": Card(closures, SPATIAL),
    "differences": Card(differences, SPATIAL),
    "frame": Card(frame, SPATIAL[:1]),
    "order": Card(order, SPATIAL[:1]),
    "units": Card(units, SPATIAL[:1]),
    "speed": Card(closures, FAST_LOOP),
    "redundant rows": Card(redundant_rows, REDUNDANT),
    "couplings, closures": Card(closures, COUPLED),
    "couplings, virtual work": Card(virtual_work, COUPLED),
}


class Verdict(NamedTuple):
    """The relative error of an engine's function by a card on a mechanism, infinite if the derivatives cannot
    be used, with the reason; None with the reason of a refusal."""

    engine: str
    function: str
    card: str
    scene: str
    error: float | None
    allowed: float
    reason: str = ""

    @property
    def fails(self) -> bool:
        """Return whether the derivatives contradict the card."""
        return self.error is not None and not self.error <= self.allowed


def verdicts(engine: Engine, cards: Sequence[str] = tuple(CARDS)) -> Iterator[Verdict]:
    """Yield the verdicts of the cards on all functions of an engine."""
    if not isinstance(engine, Differentiating):
        yield Verdict(engine.name, "", "", "", None, 0.0, str(reason(engine.name)))
        return
    allowed = max(RIGHT, IN_ROUNDINGS * engine.rounding)
    for function in engine.differentiates_by:
        subject = Subject(engine, function)
        if subject.found(SPATIAL[0].make()).by_force is None:
            yield Verdict(engine.name, function, "forces", "", None, allowed, NO_FORCES)
        for name in cards:
            for mechanism in CARDS[name].on:
                scene = mechanism.make().with_(load=[])
                source = (engine.name, function, name, mechanism.name)
                yield _verdict(subject, CARDS[name], scene, source, allowed)


def _verdict(
    subject: Subject, card: Card, scene: Scene, source: tuple[str, str, str, str], allowed: float
) -> Verdict:
    if refused := compare.refusal(subject.engine, scene):
        return Verdict(*source, None, allowed, str(refused))
    try:
        return Verdict(*source, card.check(subject, scene), allowed)
    except NotAsked as why:
        return Verdict(*source, None, allowed, str(why))
    except ValueError as failure:  # coordinates that cannot move as the joints allow
        return Verdict(*source, np.inf, allowed, str(failure))
