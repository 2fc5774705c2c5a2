"""terms: the matrices of the equations of motion of a scene at one state."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mbref.equations.initial_state import consistent_start
from mbref.equations.matrices import BodyFrames, Matrices, matrices_at
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.input_error import InputError
from mbref.method import Method, default_method
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.simulate import checked_run, checked_times, finish_run
from mbref.stepping.limits import Limits

GivenState = tuple[np.ndarray | Sequence[float], np.ndarray | Sequence[float]]


def terms(scene: Scene | str | Path, t: float = 0.0, state: GivenState | None = None) -> Matrices:
    """Return the matrices of Φ_q q̈ = γ and M q̈ + Φ_qᵀ λ = g at one state of a scene.

    Parameters
    ----------
    scene : Scene, str or path
        A Scene, the name of a built-in one, or a .toml file.
    t : float
        Time, s.
    state : tuple of coordinates (7 nb,) and velocities (6 nb,), optional
        As ``q`` and ``v`` of the result. Angles of couplings and torsion springs are then within half a turn.
        Default: the state at the time t of the motion by the default method.

    Returns
    -------
    Matrices
        M, Φ, Φ_q, ν, γ, g, q̈ and λ as arrays, with labels of rows and columns.

    Raises
    ------
    SceneError
        If the scene cannot be simulated.
    InputError
        If the state has another shape, or the motion ends before t.
    """
    (at,) = checked_times([t])
    scene = find_scene(scene).reaching(at)
    model = Model(assembled(scene))
    frames = BodyFrames(model)
    if state is not None:
        q, v = checked_state(state, model)
        q, v = frames.principal_coordinates(q), frames.principal(v)
    elif at == 0.0:
        start = consistent_start(model)
        q, v = start.q, start.v
    else:
        q, v, model.memory.values.angles[:] = _reached(scene, at)
    found = matrices_at(model, frames, float(at), q, v)
    model.release()
    return found


def checked_state(state: GivenState, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Return the arrays of a state; raises InputError for other shapes, or quaternions of no length."""
    sizes = (7 * model.nb,), (6 * model.nb,)
    try:
        q, v = (np.array(part, dtype=float) for part in state)
        fits = (q.shape, v.shape) == sizes and np.isfinite(q).all() and np.isfinite(v).all()
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise InputError(f"state: must be finite coordinates {sizes[0]} and velocities {sizes[1]}")
    poses = q.reshape(-1, 7)
    lengths = np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    if not lengths.all():
        raise InputError("state: a quaternion has no length; its four numbers must not all be 0")
    poses[:, 3:] /= lengths
    return q, v


def _reached(scene: Scene, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coordinates, velocities and angles of turning joints at a time (s); raises InputError if the
    motion ends before."""
    run = checked_run(scene, Method.parse(default_method(scene)), np.array([t]), Limits())
    motion = finish_run(run)
    samples = run.memory.loop.samples
    found = tuple(each[0].copy() for each in (samples.coordinates, samples.velocities, samples.angles))
    run.release()
    if not motion.times.size:
        raise InputError(f"t: the motion ends at {motion.t_end:g} s: {motion.message}")
    q, v, angles = found
    return q, v, angles
