"""Derivatives of accelerations and reactions at one state, along motions that the constraints allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.design.derivatives.columns import Columns, differentiable
from mbref.design.derivatives.followed import states_of_run
from mbref.design.derivatives.sensitivities import (
    DIFFERENCE_ROUNDING,
    FIRST_PRECISION,
    RTOL,
    SECOND_PRECISION,
    DerivativeRequest,
)
from mbref.design.derivatives.start_numbers import is_of_start
from mbref.design.derivatives.states import Direction, States, refuse_abrupt_springs
from mbref.design.derivatives.tangents import (
    MASSLESS,
    TangentRows,
    partition_of,
    tangent_ranks,
    tangents_at,
    with_accelerations,
)
from mbref.equations.gaps import CLOSED, gaps
from mbref.equations.initial_state import consistent_start, solve_positions
from mbref.equations.matrices import BodyFrames
from mbref.equations.model import Model, displaced
from mbref.input_error import InputError
from mbref.motions.motion import Motion
from mbref.motions.outputs import UNIT_OF, quantity_of
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.simulate import simulate
from mbref.simulation.terms import GivenState, checked_state
from mbref.stepping.limits import Limits

MOVED_AWAY = 1e-3  # displacement (lengths or rad) to a state near a singular position that is not singular
CONSISTENT = 1e-8  # violation of Φ_q v = ν / largest term, above which a given state is off the constraints


class StateBlocks(NamedTuple):
    """Arrays (o, …) of o outputs: along f displacements and f velocities, 6 nb forces, and p numbers."""

    by_position: np.ndarray
    by_velocity: np.ndarray
    by_force: np.ndarray
    by_number: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class StateDerivatives:
    """Derivatives of o outputs at one state of a scene with nb bodies and f degrees of freedom.

    The coordinates u (f,) are displacements along ``basis`` N, which the joints allow: Φ_q N = 0. Along u,
    loops stay closed, and the twists (velocity and angular velocity, world) change by the least δv,
    ½ δvᵀ M δv, that keeps Φ_q v = ν. Along u', the twists change by N. If a number changes, pose and twists
    change by the least displacement and δv in the same metric.

    Attributes
    ----------
    t : float
        Time, s.
    outputs, parameters, forces : tuple of str
        Names of the o outputs, p numbers, and 6 nb components of forces at the centres of mass (N) and of
        moments (N m), world: ``"rod.force.x"``.
    units : tuple of str
        SI units (o,) of the outputs.
    values : ndarray, shape (o,)
        The outputs at the state.
    basis : ndarray, shape (6 nb, f)
        N: of each body displacement of the centre of mass (m) and rotation vector (rad), world, by unit u.
    by_position, by_velocity : ndarray, shape (o, f)
        Derivatives along u and u'.
    by_force : ndarray, shape (o, 6 nb)
        Derivatives by forces and moments on the bodies.
    by_number : ndarray, shape (o, p)
        Derivatives by numbers of the scene.
    errors : StateBlocks
        Estimated absolute errors of the four arrays.
    """

    t: float
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    forces: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    basis: np.ndarray
    by_position: np.ndarray
    by_velocity: np.ndarray
    by_force: np.ndarray
    by_number: np.ndarray
    errors: StateBlocks

    def __repr__(self) -> str:
        o, f = self.by_position.shape
        return f"<StateDerivatives of {o} outputs at t = {self.t:g} s: {f} degrees of freedom>"


def state_derivatives(
    scene: Scene | str | Path,
    of: Sequence[str] | None = None,
    to: Sequence[str] = (),
    t: float = 0.0,
    state: GivenState | None = None,
) -> StateDerivatives:
    """Return derivatives of accelerations, or of other outputs, at one state of a scene.

    They follow from the linearised equations Φ_q δa = δγ and M δa + Φ_qᵀ δλ = δg, on the constraints.

    Parameters
    ----------
    scene : Scene, str or path
        A Scene, the name of a built-in one, or a .toml file.
    of : sequence of str, optional
        Outputs, as of ``sensitivities``, such as ``"B.force"``. Default: acceleration and angular
        acceleration of each body, world.
    to : sequence of str
        Numbers of the scene, as of ``sensitivities``, but none of the start.
    t : float
        Time, s.
    state : tuple of coordinates (7 nb,) and velocities (6 nb,), optional
        As ``q`` and ``v`` of ``terms``, on the constraints at time t. Default: the state at the time t of the
        motion by the default method.

    Returns
    -------
    StateDerivatives
        Outputs, and their derivatives with estimated errors.

    Raises
    ------
    SceneError
        If the scene has no number at a path, or the ends of a spring meet where its force has no direction.
    InputError
        At a singular position, for a state off the constraints, without the mass of a body that moves
        freely, and for the reasons of ``sensitivities``.
    """
    scene = find_scene(scene)
    for label in to:
        if is_of_start(label):
            raise InputError(f"{label}: is a number of the start; a state does not depend on it")
    if of is None:
        kinds = ("acceleration", "angular_acceleration")
        of = [f"{body.name}.{kind}" for body in scene.body for kind in kinds]
    request = DerivativeRequest(scene, of, to or None, [t])
    motion, at = _state(request, state)
    names = differentiable(motion, of)
    first, second = (
        _Blocks(request, motion, names, at, each.step) for each in (FIRST_PRECISION, SECOND_PRECISION)
    )
    request.model.release()
    return _compared(first, second, float(request.samples[0]))


def _state(request: DerivativeRequest, given: GivenState | None) -> tuple[Motion, States]:
    """Return a motion of the scene with one sample, and the state (1,); raises InputError for a state off
    the constraints, or a singular one."""
    model, scene, times = request.model, request.scene, request.samples
    if given is None:
        motion, at = states_of_run(scene, request.method, Limits(rtol=RTOL), times)
        if not motion.times.size:
            raise InputError(f"t: the motion ends at {motion.t_end:g} s: {motion.message}")
    else:
        motion, frames = simulate(scene, times=[0.0]), BodyFrames(model)
        if not motion.times.size:
            raise InputError(f"{scene.name}: {motion.message}")
        q, v = checked_state(given, model)
        none = np.zeros((1, model.n))
        angles = np.zeros((1, len(model.structure.places.turning)))
        q, v = frames.principal_coordinates(q), frames.principal(v)
        at = States(times, q[None], v[None], angles, none, np.zeros((1, model.m)))
        _refuse_broken_constraints(model, at)
    _refuse_state_without_derivatives(model, at, scene.name, request.has_points)
    return motion, at


def _refuse_broken_constraints(model: Model, at: States) -> None:
    """Raise InputError for a state (1,) that violates the constraints."""
    terms = model.terms(at.times, at.q, at.v, at.angles)[0]
    gap = float(gaps(terms, model.length).max(initial=0.0))
    if gap > CLOSED:
        raise InputError(f"state: is off the constraints by {gap:.2g} lengths of the mechanism or rad")
    off = terms.jacobian @ at.v[0] - terms.nu
    scale = np.abs(terms.jacobian) @ np.abs(at.v[0]) + np.abs(terms.nu)
    if (np.abs(off) > CONSISTENT * scale.max(initial=0.0)).any():
        raise InputError(f"state: its velocities are off the constraints by {np.abs(off).max():.2g}")


def _refuse_state_without_derivatives(model: Model, at: States, name: str, by_points: bool) -> None:
    """Raise InputError if the rank of the constraints at a state (1,) is less than near it, and SceneError
    where a spring acts abruptly, see ``refuse_abrupt_springs``."""
    t, rank = float(at.times[0]), tangent_ranks(model, at)[0]
    singular = f"{name}: the state at t = {t:g} s is a singular position, where derivatives do not exist"
    if t == 0.0 and consistent_start(model).follows_branch:
        raise InputError(singular)
    rows = TangentRows(model, at, partition_of(model, at))
    refuse_abrupt_springs(model, at, rows.basis[0], by_points)
    for direction in rows.basis[0].T:
        x = MOVED_AWAY * direction / np.abs(direction).max() * model.units
        q, _ = solve_positions(model, t, displaced(at.q[0], x))
        if tangent_ranks(model, at._replace(q=q[None]))[0] != rank:
            raise InputError(singular)


class _Blocks:
    """Outputs at a state, their derivatives, and the rounding of the differences; ``basis`` is N."""

    def __init__(
        self, request: DerivativeRequest, motion: Motion, names: Sequence[str], at: States, step: float
    ):
        self.model, self.step, self.names = request.model, step, [*names]
        self.numbers, self.labels = request.numbers, request.labels
        self.columns = Columns(motion, names, step)
        self.partition = partition_of(self.model, at)
        self.rows = TangentRows(self.model, at, self.partition)
        self.at = with_accelerations(at, self.rows)
        self.own = len(request.scene.body)
        tangents = tangents_at(self.model, self.at, self.rows, self.numbers)
        for number, is_open in zip(self.numbers, tangents.open, strict=True):
            if is_open:
                raise InputError(f"{number.label}: the joints cannot stay closed if this number changes")
        units = self.model.units[:, None]
        self.changes = [
            tangents.x[0] * units,
            tangents.v[0] * units,
            tangents.a[0],
            tangents.multipliers[0],
        ]
        self.f = self.rows.basis.shape[2]
        self._turn_with_the_world()
        self.basis = self._in_the_world(self.changes[0][:, : self.f])
        parts = [*self.changes]
        for place, forced in enumerate(self._forced()):
            parts[place] = np.concatenate([parts[place], forced], axis=1)
        self.blocks, self.rounding = self._outputs(parts)
        self.values = self.columns.at(motion.mechanism, self.model, self.at)[0]

    def _turn_with_the_world(self) -> None:
        """Change poses and twists by the least amounts in the metric M; twists are world vectors."""
        f = self.f
        free = self.changes[0][:, :f]
        mass = self.rows.terms.mass[:, None]
        inverse = np.linalg.pinv(free.T @ (mass * free), rcond=MASSLESS, hermitian=True)
        moves = -inverse @ (free.T @ (mass * self.changes[0][:, 2 * f :]))
        for each in self.changes:
            each[:, 2 * f :] += each[:, :f] @ moves
        x, v = self.changes[:2]
        turned = v.copy()
        self._angular(turned)[:] += np.cross(self._angular(x), self._spin(), axis=1)
        rates = -inverse @ (free.T @ (mass * turned))
        rates[:, f : 2 * f] = 0.0
        self.changes = [each + each[:, f : 2 * f] @ rates for each in self.changes]

    def _angular(self, x: np.ndarray) -> np.ndarray:
        """Return the view (nb, 3, c) of rotations of x (n, c)."""
        return x.reshape(self.model.nb, 2, 3, -1)[:, 1]

    def _spin(self) -> np.ndarray:
        """Return the angular velocities (nb, 3, 1), body axes."""
        return self._angular(self.at.v[0][:, None])

    def _in_the_world(self, x: np.ndarray) -> np.ndarray:
        """Return x (n, c) of the scene's bodies with rotations along world axes (6 nb, c)."""
        found = x.copy()
        self._angular(found)[:] = self._axes() @ self._angular(x)
        return found[: 6 * self.own]

    def _axes(self) -> np.ndarray:
        return rotations.to_matrix(self.at.q[0].reshape(-1, 7)[:, 3:])

    def _forced(self) -> tuple[np.ndarray, ...]:
        """Return the changes of x, v (zero), a and λ by unit forces and moments on the scene's bodies."""
        n, count = self.model.n, 6 * self.own
        force = np.eye(n, count)
        self._angular(force)[:] = np.swapaxes(self._axes(), 1, 2) @ self._angular(force)
        a, multipliers = self.rows.solve(np.zeros((1, self.model.m, count)), force[None])
        return np.zeros((n, count)), np.zeros((n, count)), a[0], multipliers[0]

    def _outputs(self, parts: Sequence[np.ndarray]) -> tuple[StateBlocks, StateBlocks]:
        """Return the derivatives of the outputs along changes (n, c), and the rounding of differences."""
        count, f, p = parts[0].shape[1], self.f, len(self.numbers)
        many = States(*(np.repeat(each, count, axis=0) for each in self.at))
        found = self.columns.along(self.model, many, Direction(*(part.T for part in parts)))
        split = [np.split(each.T, [f, 2 * f, 2 * f + p], axis=1) for each in found]
        for k, number in enumerate(self.numbers):
            own = self.columns.by_number(number, self.at, self.model)
            for whole, each in zip(split, own, strict=True):
                whole[2][:, k] += each[0]
        of_values, of_rounding = (StateBlocks(s[0], s[1], s[3], s[2]) for s in split)
        return of_values, of_rounding


def _compared(first: _Blocks, second: _Blocks, t: float) -> StateDerivatives:
    """Return the more accurate derivatives, with the difference of both as their error."""
    # the two computations have one partition, so one basis
    relative = [number.error for number in second.numbers]
    errors = []
    for place, (one, other, rounding) in enumerate(
        zip(first.blocks, second.blocks, second.rounding, strict=True)
    ):
        share = DIFFERENCE_ROUNDING + (np.array(relative) if place == 3 else 0.0)
        errors.append(np.abs(one - other) + rounding + share * np.abs(other).max(initial=0.0))
    scene = second.columns.motion.mechanism
    forces = (f"{b.name}.{kind}.{axis}" for b in scene.body for kind in ("force", "moment") for axis in "xyz")
    return StateDerivatives(
        t,
        tuple(second.names),
        second.labels,
        tuple(forces),
        tuple(UNIT_OF[quantity_of(name)] for name in second.names),
        second.values,
        second.basis,
        *second.blocks,
        StateBlocks(*errors),
    )
