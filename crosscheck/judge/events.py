"""Events of a run, by the judge: its pieces, from the poses at its own events, and the balances there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.judge.constraints import joint_coordinates, scene_length
from crosscheck.judge.energy import energy_balance
from crosscheck.judge.impacts import Impact
from crosscheck.judge.joint_reactions import resultants
from crosscheck.judge.loads import world_inertia
from crosscheck.judge.pieces import State, at_start, followed, has_pieces, later, names_of, permanent
from crosscheck.judge.stops import bounced, ends_of, held, hits
from mbref import rotations
from mbref.motions.event import Event
from mbref.motions.trajectory import PER_BODY, Trajectory
from mbref.scene import Scene


def parts(
    scene: Scene, trajectory: Trajectory, exact: Trajectory | None
) -> Iterator[tuple[Scene, Trajectory, Trajectory | None]]:
    """Yield scene, samples and exact motion of each piece of a run, whose times count from its begin.

    A scene without intervals has one piece. A run without events has none, as its constraints are not known.
    """
    if not has_pieces(scene):
        yield scene, trajectory, exact
        return
    begin, turned = 0.0, dict[str, float]()
    for end, piece in _pieces(scene, trajectory):
        own = _between(trajectory, begin, end, turned)
        if own.times.size:
            yield piece, own, None if exact is None else _between(exact, begin, end, {})
        begin = end
        turned = next((dict(e.angles) for e in trajectory.events or () if e.time == end), {})


def _pieces(scene: Scene, trajectory: Trajectory) -> Iterator[tuple[float, Scene]]:
    """Yield the end (s) and the scene of each piece of a run, from the states at its events."""
    if trajectory.events is None:
        return
    piece = at_start(scene)
    contacts: tuple[str, ...] = ()
    for event in trajectory.events:
        yield event.time, held(piece, contacts)
        piece, contacts = _after(scene, piece, event), event.contacts
    yield np.inf, held(piece, contacts)


def _after(scene: Scene, piece: Scene, event: Event) -> Scene:
    """Return the piece that begins at an event of a run, with the velocities that the judge finds from the
    run's velocities before it: they obey the constraints exactly."""
    before, moved = _before(event), _moved(scene, event)
    names = (names_of(piece) | {*event.engaged}) - {*event.released}
    after = later(scene, piece, event.time, before, moved, names)
    return later(scene, piece, event.time, _jump(scene, after, event).state, moved, names)


def _jump(scene: Scene, after: Scene, event: Event) -> Impact:
    """Return the judge's impact at an event, with the end stops that the run met."""
    before, bare = _before(event), after.with_(driver=after.driver[: len(scene.driver)])
    touching = [end for end in ends_of(scene) if end.name in (*event.stops, *event.contacts, *event.released)]
    wanted = hits(bare, [end for end in touching if end.name in event.stops], before, ())
    wanted |= {end: 0.0 for end in wanted if end.name in event.chatter}
    return bounced(bare, before, touching, wanted)


def _before(event: Event) -> State:
    """Return the state of a run before an event."""
    return State(event.position, event.orientation, event.velocity, event.angular_velocity)


def _moved(scene: Scene, event: Event) -> dict[str, np.ndarray]:
    """Return angle (rad, as the run counted it, or NaN) and displacement (m) (2,) of followed joints."""
    joints = [permanent(joint) for joint in scene.joint if joint.is_permanent]
    always = scene.with_(joint=joints, coupling=(), load=())
    pose = event.position[None], event.orientation[None], 0.0 * event.angular_velocity[None]
    found = joint_coordinates(always, np.zeros(1), *pose)
    return {name: np.array([event.angles.get(name, np.nan), found[name][0, 1]]) for name in followed(scene)}


def _between(motion: Trajectory, begin: float, end: float, turned: dict[str, float]) -> Trajectory:
    """Return the samples from begin to end (s), with times and angles (rad) from the begin."""
    chosen = (motion.times >= begin) & (motion.times < end)
    own = at_samples(motion, chosen)
    angles = own.angles and {name: rows - turned.get(name, 0.0) for name, rows in own.angles.items()}
    return replace(own, times=own.times - begin, angles=angles, events=None)


def at_samples(trajectory: Trajectory, chosen: np.ndarray) -> Trajectory:
    """Return the trajectory at some of its samples, by their indices (n,) or a mask (k,)."""
    arrays: dict[str, Any] = {
        key: None if (values := getattr(trajectory, key)) is None else values[chosen]
        for key in ("times", *PER_BODY)
    }
    tables: dict[str, Any] = {
        key: values and {name: rows[chosen] for name, rows in values.items()}
        for key in ("reactions", "open_reactions", "angles")
        for values in [getattr(trajectory, key)]
    }
    return replace(trajectory, **arrays, **tables)


def energy_error(scene: Scene, trajectory: Trajectory) -> float | None:
    """Return the largest drift of the energy balance within a piece, relative to the largest energy of all
    pieces; None where a piece has no balance."""
    found = [energy_balance(piece, own) for piece, own, _ in parts(scene, trajectory, None)]
    known = [balance for balance in found if balance is not None]
    scale = max((size for _, size in known), default=0.0)
    if not scale or len(known) < len(found):
        return None
    return max(float(np.abs(gain).max()) for gain, _ in known) / scale


def event_time_error(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
    """Return the largest distance (s) of an event of a run from the nearest event of the reference, or
    of one of these from the nearest event of the run; None without events on one side."""
    if exact is None or not trajectory.events or not exact.settings.get("events"):
        return None
    theirs, end = np.array([event.time for event in trajectory.events]), exact.times.max(initial=0.0)
    apart = np.abs(theirs[theirs <= end, None] - np.array(exact.settings["events"]))
    if not apart.size:
        return None
    return float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))


def impulse_error(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
    """Return the largest difference of a body's change of momentum at an event from the impulses of its
    joints, relative to the largest momentum; None where a run does not give all impulses."""
    off, scale = [0.0], [0.0]
    for event, after in _impacts(scene, trajectory):
        if not {joint.name for joint in after.joint} <= set(event.impulses):
            continue
        units = np.repeat([1.0, scene_length(scene)], 3)
        jump = event.velocity_after - event.velocity, event.angular_velocity_after - event.angular_velocity
        change = _momenta(scene, event, *jump) / units
        before = _momenta(scene, event, event.velocity, event.angular_velocity) / units
        one = {name: wrench[None] for name, wrench in event.impulses.items()}
        state: dict[str, Any] = {"position": event.position[None], "orientation": event.orientation[None]}
        pulls = resultants(after, replace(trajectory, **state, reactions=one), 0) / units
        off.append(float(np.abs(change - pulls).max()))
        scale.append(float(max(np.abs(change).max(), np.abs(before).max())))
    return max(off) / max(scale) if max(scale) else None


def impact_error(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
    """Return the largest error of a velocity after an event, from the run's own velocities before it; angular
    velocities times the scene's length, relative to the largest velocity before; None without impacts."""
    off, scale, length = [0.0], [0.0], scene_length(scene)
    for event, after in _impacts(scene, trajectory):
        found = _jump(scene, after, event).state
        off.append(float(np.abs(found.velocity - event.velocity_after).max()))
        off.append(length * float(np.abs(found.angular_velocity - event.angular_velocity_after).max()))
        scale += [float(np.abs(event.velocity).max()), length * float(np.abs(event.angular_velocity).max())]
    return max(off) / max(scale) if max(scale) else None


def impact_energy_error(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
    """Return the largest difference of the energy lost at an event from the kinetic energy of the lost
    velocities, relative to the energy before; None with drivers, which do work."""
    off = []
    for event, after in _impacts(scene, trajectory):
        if not scene.driver and event.energy_before and not event.stops:
            lost = event.energy_before - event.energy_after
            off.append(abs(lost - _jump(scene, after, event).lost) / event.energy_before)
    return max(off, default=None)


def _impacts(scene: Scene, trajectory: Trajectory) -> Iterator[tuple[Event, Scene]]:
    """Yield the events of a run at which velocities jump, with the scene after each."""
    if not has_pieces(scene) or not trajectory.events:
        return
    scenes = [piece for _, piece in _pieces(scene, trajectory)]
    for event, after in zip(trajectory.events, scenes[1:], strict=True):
        if event.jumps:
            yield event, after


def _momenta(scene: Scene, event: Event, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return momentum, and angular momentum about the centre of mass (nb, 6), world, of velocities (nb, 3) at
    the poses of an event."""
    mass = np.array([body.mass or 0.0 for body in scene.body])[:, None]
    inertia = world_inertia(scene, rotations.to_matrix(event.orientation[None]))[0]
    return np.hstack([mass * velocity, np.einsum("bij,bj->bi", inertia, spin)])
