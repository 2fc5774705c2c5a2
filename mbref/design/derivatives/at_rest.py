"""Derivatives of a static equilibrium with respect to numbers of the scene, by the implicit function."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mbref.design.derivatives.columns import Columns
from mbref.design.derivatives.panels import Precision
from mbref.design.derivatives.result import Sensitivities
from mbref.design.derivatives.sensitivities import (
    FIRST_PRECISION,
    SECOND_PRECISION,
    DerivativeRequest,
    Derivatives,
    compared,
)
from mbref.design.derivatives.start_numbers import is_of_start
from mbref.design.derivatives.states import Direction, States
from mbref.design.derivatives.tangents import (
    TangentRows,
    partition_of,
    tangents_at,
    with_accelerations,
)
from mbref.equations.initial_state import consistent_start
from mbref.input_error import InputError
from mbref.motions.motion import Motion
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
        If the scene has no number at a path.
    InputError
        If the scene is not at rest in an equilibrium, has no masses, or is in neutral equilibrium, and for
        the reasons of ``sensitivities``.
    """
    scene = find_scene(scene)
    if not scene.has_mass():
        raise InputError(f"{scene.name}: an equilibrium needs the mass and inertia of every body")
    for label in to:
        if is_of_start(label):
            raise InputError(f"{label}: an equilibrium does not depend on numbers of the start")
    request, motion = DerivativeRequest(scene, of, to, [0.0]), simulate(scene, times=[0.0])
    if not motion.times.size:
        raise InputError(f"{scene.name}: {motion.message}")
    request.motion = motion
    first, second = (_solved(request, motion, each) for each in (FIRST_PRECISION, SECOND_PRECISION))
    request.model.release()
    return compared(first, second, request)


def _solved(request: DerivativeRequest, motion: Motion, precision: Precision) -> Derivatives:
    """Return the derivatives (1, outputs, numbers) at the equilibrium, and the rounding of differences."""
    model, step = request.model, precision.step
    numbers = request.numbers
    start = consistent_start(model)
    if start.v.any():
        raise InputError(f"{request.scene.name}: is not at rest; {FIND_EQUILIBRIUM}")
    none = np.zeros((1, model.n)), np.zeros((1, model.m))
    angles = np.zeros((1, len(model.structure.places.turning)))
    state = States(np.zeros(1), start.q[None], none[0], angles, *none)
    rows = TangentRows(model, state, partition_of(model, state))
    driven = np.abs(rows.placed(rows.terms.gamma[..., None])).max(initial=0.0) * request.scene.duration**2
    if driven > AT_BALANCE:  # displacement in the scene's duration
        raise InputError(f"{request.scene.name}: is not in equilibrium; a driver accelerates it")
    state = with_accelerations(state, rows)
    found, f = tangents_at(model, state, rows, numbers, step), rows.basis.shape[2]
    # a by (u, u', numbers), and a itself
    rates = np.concatenate([found.a[0], state.a.T], axis=1)[rows.partition.independent]
    stiffness = np.linalg.svd(rates[:, :f], compute_uv=False)
    if stiffness.min(initial=np.inf) <= NEUTRAL * stiffness.max(initial=0.0):
        raise InputError(f"{request.scene.name}: a neutral equilibrium does not determine its pose")
    moved = -np.linalg.solve(rates[:, :f], rates[:, 2 * f :])
    if np.abs(found.x[0][:, :f] @ moved[:, -1]).max(initial=0.0) > AT_BALANCE:
        raise InputError(f"{request.scene.name}: is not in equilibrium; {FIND_EQUILIBRIUM}")
    columns, pairs = Columns(motion, request.outputs, step), []
    for k, number in enumerate(numbers):
        x, multipliers = (
            each[..., :f] @ moved[:, k] + each[..., 2 * f + k] for each in (found.x, found.multipliers)
        )
        along = Direction(x * model.units, none[0], none[0], multipliers)
        pairs.append(np.add(columns.along(model, state, along), columns.by_number(number, state)))
    values, rounding = np.stack(pairs, axis=-1)
    return Derivatives(np.inf, columns.names, values, rounding)
