"""Derivatives of a static equilibrium with respect to numbers of the scene, by the implicit function."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbref.design.derivatives.columns import Columns
from mbref.design.derivatives.result import Sensitivities
from mbref.design.derivatives.sensitivities import (
    FIRST_PRECISION,
    SECOND_PRECISION,
    DerivativeRequest,
    Derivatives,
    compared,
)
from mbref.design.derivatives.start_numbers import is_of_start
from mbref.design.derivatives.states import Direction, States, refuse_abrupt_springs, state_at_rest
from mbref.design.derivatives.tangents import (
    TangentRows,
    partition_of,
    tangents_at,
    with_accelerations,
)
from mbref.equations.initial_state import consistent_start
from mbref.equations.row_factors import RowPartition
from mbref.input_error import InputError
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.simulate import simulate

FIND_EQUILIBRIUM = "mbref.equilibria(scene)[0].scene is"
AT_BALANCE = 1e-7  # displacement (lengths of the mechanism, or rad) to the equilibrium that is rounding
NEUTRAL = 1e-10  # stiffness / largest stiffness below which an equilibrium does not determine its pose


def equilibrium_sensitivities(
    scene: Scene | str | Path, of: Sequence[str], to: Sequence[str]
) -> Sensitivities:
    """Return derivatives of outputs of a static equilibrium with respect to numbers of the scene.

    If a number p changes, the pose moves by δu along the freedoms so that the accelerations a stay zero:
    ∂a/∂u δu = -∂a/∂p. All other numbers of the scene stay as they are.

    Parameters
    ----------
    scene : Scene, str or path
        A scene whose pose is an equilibrium, such as ``mbref.equilibria(scene)[0].scene``.
    of : sequence of str
        Outputs, as of ``sensitivities``.
    to : sequence of str
        Paths of numbers of the scene, as of ``sensitivities``.

    Returns
    -------
    Sensitivities
        With one sample, at t = 0.

    Raises
    ------
    SceneError
        If the scene has no number at a path, or the ends of a spring meet where its force has no direction.
    InputError
        If the scene is not at rest in an equilibrium, has no masses, or is in neutral equilibrium, and for
        the reasons of ``sensitivities``.
    """
    request = equilibrium_request(scene, of, to)
    motion = simulate(request.scene, times=[0.0])
    if not motion.times.size:
        raise InputError(f"{request.scene.name}: {motion.message}")
    request.motion = motion
    first, second = (_solved(request, each.step) for each in (FIRST_PRECISION, SECOND_PRECISION))
    request.model.release()
    return compared(first, second, request)


def equilibrium_request(
    scene: Scene | str | Path, of: Sequence[str] | None, to: Sequence[str]
) -> DerivativeRequest:
    """Return the request for derivatives of a scene at rest; raises InputError for one without masses and
    for numbers of the start."""
    scene = find_scene(scene)
    if not scene.has_mass():
        raise InputError(f"{scene.name}: an equilibrium needs the mass and inertia of every body")
    for label in to:
        if is_of_start(label):
            raise InputError(f"{label}: an equilibrium does not depend on numbers of the start")
    return DerivativeRequest(scene, of, to, [0.0])


class MovedEquilibrium(NamedTuple):
    """The state (1,) of an equilibrium, the partition of its rows, and the changes of the pose x (n, numbers)
    in m and rad, and of the multipliers (m, numbers), by numbers of the scene."""

    state: States
    partition: RowPartition
    x: np.ndarray
    multipliers: np.ndarray


def moved_equilibrium(request: DerivativeRequest, step: float) -> MovedEquilibrium:
    """Return how the equilibrium moves; raises InputError for a scene that is in none, or in a neutral
    one."""
    model, name = request.model, request.scene.name
    start = consistent_start(model)
    if start.v.any():
        moving = next((driver.joint for driver in request.scene.driver if not driver.is_constant), None)
        why = f"the driver of {moving!r} moves it" if moving else FIND_EQUILIBRIUM
        raise InputError(f"{name}: is not at rest; {why}")
    state = state_at_rest(model, start.q)
    rows = TangentRows(model, state, partition_of(model, state))
    driven = np.abs(rows.placed(rows.terms.gamma[..., None])).max(initial=0.0) * request.scene.duration**2
    if driven > AT_BALANCE:  # displacement in the scene's duration
        raise InputError(f"{name}: is not in equilibrium; a driver accelerates it")
    refuse_abrupt_springs(model, state, rows.basis[0], request.has_points)
    state = with_accelerations(state, rows)
    found, f = tangents_at(model, state, rows, request.numbers), rows.basis.shape[2]
    # a by (u, u', numbers), and a itself
    rates = np.concatenate([found.a[0], state.a.T], axis=1)[rows.partition.independent]
    stiffness = np.linalg.svd(rates[:, :f], compute_uv=False)
    if stiffness.min(initial=np.inf) <= NEUTRAL * stiffness.max(initial=0.0):
        raise InputError(f"{name}: a neutral equilibrium does not determine its pose")
    moved = -np.linalg.solve(rates[:, :f], rates[:, 2 * f :])
    if np.abs(found.x[0][:, :f] @ moved[:, -1]).max(initial=0.0) > AT_BALANCE:
        raise InputError(f"{name}: is not in equilibrium; {FIND_EQUILIBRIUM}")
    x, multipliers = (
        each[0][:, :f] @ moved[:, :-1] + each[0][:, 2 * f :] for each in (found.x, found.multipliers)
    )
    return MovedEquilibrium(state, rows.partition, x * model.units[:, None], multipliers)


def _solved(request: DerivativeRequest, step: float) -> Derivatives:
    """Return the derivatives (1, outputs, numbers) at the equilibrium, and the rounding of differences."""
    found, model, pairs = moved_equilibrium(request, step), request.model, []
    assert request.motion is not None
    columns, still = Columns(request.motion, request.outputs, step), np.zeros((1, model.n))
    for k, number in enumerate(request.numbers):
        along = Direction(found.x[None, :, k], still, still, found.multipliers[None, :, k])
        by_state = columns.along(model, found.state, along)
        pairs.append(np.add(by_state, columns.by_number(number, found.state, model)))
    values, rounding = np.stack(pairs, axis=-1)
    return Derivatives(np.inf, columns.names, values, rounding)
