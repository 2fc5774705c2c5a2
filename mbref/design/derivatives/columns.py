"""Derivatives of the columns of a motion along changes of its states, and by numbers at equal states."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mbref.design.derivatives.numbers_of_scene import SceneNumber, variants_of
from mbref.design.derivatives.states import Direction, States, terms_along
from mbref.design.differences import directional_derivative
from mbref.equations.joint_angles import angles_at
from mbref.equations.joint_reactions import reactions
from mbref.equations.model import Model
from mbref.equations.offsets import counted_angles
from mbref.input_error import InputError
from mbref.motions.motion import Motion
from mbref.motions.outputs import all_columns, chosen, quantity_of
from mbref.scene import Scene
from mbref.scene.bodies import DRIVER

EPSILON = float(np.finfo(float).eps)
# error of a difference / its terms: up to RESOLVED_COLUMN no further step is tried, and above UNRESOLVED a
# smaller step is tried though the last one gave no better derivative, as of fast functions of time
RESOLVED_COLUMN, UNRESOLVED = 100.0 * EPSILON, 1e-6
# quantities that count, are largest values, or vanish on the exact motion
WITHOUT_DERIVATIVE = (
    *("time", "open", "active", "impulse", "angular_impulse", "largest_reaction", "error_estimate"),
    *("position_violation", "velocity_violation", "acceleration_violation"),
)


FORCES = ("force", "moment", "torque", "power")  # quantities of joints and drivers that need reactions


def differentiable(motion: Motion, names: Sequence[str]) -> list[str]:
    """Return the columns of a motion with these names or beginnings.

    Raises InputError for a column without derivatives, and for a reaction that redundant constraints share.
    """
    found = chosen(motion.columns(), names)
    for column, reason in without_derivative(motion, found).items():
        raise InputError(f"of: {column!r} {reason}")
    return found


def without_derivative(motion: Motion, columns: Sequence[str]) -> dict[str, str]:
    """Return the columns of a motion that have no derivative, with reasons."""
    plain = [name for name in columns if name != "time" and quantity_of(name) not in WITHOUT_DERIVATIVE]
    needs_reactions = any(quantity_of(name) in FORCES for name in plain)
    shared = _shared(motion) if needs_reactions else set()
    because = "has no derivative: redundant constraints share it, and equilibrium does not determine it"
    return {
        name: because if name in plain else "has no derivative"
        for name in columns
        if name not in plain or name in shared
    }


def _shared(motion: Motion) -> set[str]:
    """Return the columns of reactions and drivers that equilibrium does not determine."""
    scene, found = motion.mechanism, set()
    for name, determined in motion.determined_reactions.items():
        for k in np.flatnonzero(~determined.all(axis=0)):
            found.add(f"{name}.{'force' if k < 3 else 'moment'}.{'xyz'[k % 3]}")
    for driver in scene.driver:
        if (marks := motion.driver(driver.joint).open) is not None and marks.any():
            found |= {f"{DRIVER.format(driver.joint)}.{quantity}" for quantity in FORCES}
    return found


def _angles(model: Model, states: States) -> np.ndarray:
    """Return the angles (k, a) of turning joints at the poses of states, which polynomials of couplings
    read."""
    if not model.data.primitives.higher.any():
        return states.angles
    pairs = zip(states.q, states.angles, strict=True)
    return np.array([angles_at(model, q, near) for q, near in pairs]).reshape(states.angles.shape)


class Columns:
    """Columns (k, columns) of a motion as a function of its states."""

    def __init__(self, motion: Motion, names: Sequence[str], step: float | np.ndarray):
        self.motion, self.names, self.step = motion, [*names], step
        self._has_reactions = any(quantity_of(name) in FORCES for name in names)

    def at(self, scene: Scene, model: Model, states: States) -> np.ndarray:
        """Return the columns at states of the model of a scene."""
        k, nb = states.times.size, model.nb
        q, v, a = states.q.reshape(k, nb, 7), states.v.reshape(k, nb, 6), states.a.reshape(k, nb, 6)
        wrenches = None
        if self._has_reactions and not model.kinematic:
            blocks = terms_along(model, states).blocks
            wrenches = reactions(model, q, blocks, states.multipliers, _angles(model, states))
        motion = replace(
            self.motion,
            mechanism=scene,
            times=states.times,
            **model.motion(q, v, a),
            reactions=wrenches,
            open_reactions=None,
            angles=counted_angles(scene, model.structure, states.angles),
        )
        table = all_columns(motion, self.names)
        return np.array([table[name] for name in self.names]).T

    def along(self, model: Model, states: States, direction: Direction) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivative (k, columns) along a direction of states, and its rounding."""
        steps, largest = direction.steps(states, model, self.step), np.zeros(len(self.names))

        def at(h: np.ndarray) -> np.ndarray:
            return self._noted(largest, self.motion.mechanism, model, states.moved(direction, h))

        change, apart = directional_derivative(at, steps), steps[:, None]
        return change / apart, EPSILON * self._largest(largest) / apart

    def by_number(self, number: SceneNumber, states: States, base: Model) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivative (k, columns) by a number at equal states, and its error; ``base`` is the
        model of the scene.

        A column such as the torque sin(ω t) of a load is not affine in a number in which the scene's arrays
        are. Then stencils of order 8 with smaller and smaller steps follow; each column has the best one.
        """
        shape = states.times.size, len(self.names)
        largest, found, errors = np.zeros(shape[1]), np.zeros(shape), np.full(shape, np.inf)

        def at(scene: Scene, model: Model) -> np.ndarray:
            return self._noted(largest, scene, model, states)

        further = variants_of(self.motion.mechanism, number.label, base)
        for variants in itertools.chain([number.variants], further):
            values, error = variants.derivative(at)
            most = self._largest(largest) * np.abs(variants.stencil.weights).max() / variants.step
            error += EPSILON * most
            worst, before = (each.max(axis=0, initial=0.0) for each in (error, errors))
            is_better = worst < before
            found[:, is_better], errors[:, is_better] = values[:, is_better], error[:, is_better]
            may_improve = is_better & (worst > RESOLVED_COLUMN * most) | (worst > UNRESOLVED * most)
            if not may_improve.any():
                break
        return found, errors

    def _noted(self, largest: np.ndarray, scene: Scene, model: Model, states: States) -> np.ndarray:
        """Return the columns at states, and update the largest values (columns,) in place."""
        found = self.at(scene, model, states)
        np.maximum(largest, np.abs(found).max(axis=0, initial=0.0), out=largest)
        return found

    def _largest(self, values: np.ndarray) -> np.ndarray:
        """Return the largest of values (columns,) of one quantity, whose components round alike."""
        quantities = np.array([*map(quantity_of, self.names)])
        return np.array([values[quantities == quantity].max() for quantity in quantities])
