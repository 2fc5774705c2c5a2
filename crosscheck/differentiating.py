"""The interface of engines that have functions of their own for derivatives of accelerations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mbref.scene import Scene

# (displacement along unit velocities, velocity, acceleration), each (nv,) → twists and accelerations (6 nb,)
BodyMotion = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
Opening = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (displacement, velocity) → rates (m,) of closures
# (displacement, velocity, generalised force), each (nv,) → acceleration (nv,)
OwnAccelerations = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def _none(step: np.ndarray, rate: np.ndarray) -> np.ndarray:
    return np.zeros(0)


@dataclass(frozen=True)
class OwnDerivatives:
    """Derivatives of an engine's accelerations in its own coordinates, at one state.

    Attributes
    ----------
    coordinates : tuple of str
        Names (nv,) of the coordinates, such as their joints.
    velocity, acceleration : ndarray, shape (nv,)
        The engine's velocities and accelerations at the state.
    by_position, by_velocity : ndarray, shape (nv, nv)
        Derivatives of the accelerations along unit velocities, and by velocities.
    by_force : ndarray, shape (nv, nv), or None
        Derivatives by generalised forces; None if the function has none.
    bodies : callable
        Kinematics: of a displacement along unit velocities, velocities and accelerations (nv,), the twists
        and accelerations (6 nb,) of the scene's bodies: of each the centre of mass, then the rotation, world.
    opening : callable
        Rates (m,) at which the closures of loops open, of a displacement and velocities (nv,); empty without
        closures.
    own : callable
        The function that is differentiated: of a displacement, velocities and generalised forces (nv,), the
        accelerations (nv,). It need not satisfy the constraints.
    spins : callable
        Rates (k,) of parts that the scene does not have and that its bodies leave free, such as the spin of
        rods of distance joints about their own axes; of a displacement and velocities (nv,).
    """

    coordinates: tuple[str, ...]
    velocity: np.ndarray
    acceleration: np.ndarray
    by_position: np.ndarray
    by_velocity: np.ndarray
    by_force: np.ndarray | None
    bodies: BodyMotion
    opening: Opening
    own: OwnAccelerations
    spins: Opening = _none


@dataclass(frozen=True)
class TangentDerivatives:
    """Derivatives of the accelerations (6 nb,) of the bodies along motions that the constraints allow.

    Attributes
    ----------
    basis : ndarray, shape (6 nb, f)
        Twists by unit coordinates u.
    by_position, by_velocity : ndarray, shape (6 nb, f)
        Along u, with the least change of the twists in the metric of the masses, and along u'.
    by_force : ndarray, shape (6 nb, 6 nb), or None
        By forces at the centres of mass and moments, world.
    """

    basis: np.ndarray
    by_position: np.ndarray
    by_velocity: np.ndarray
    by_force: np.ndarray | None


class Differentiating(ABC):
    """Interface that an engine's adapter implements beside ``Engine`` if the engine has derivatives.

    Attributes
    ----------
    differentiates_by : mapping of str to str
        The engine's functions, or ways to call one, each with a description. The first one is what the
        engine's documentation recommends.
    """

    differentiates_by: Mapping[str, str]

    @abstractmethod
    def own_derivatives(
        self, scene: Scene, function: str, away: np.ndarray | None = None
    ) -> OwnDerivatives | TangentDerivatives:
        """Return the derivatives of accelerations at the scene's start by one of the engine's functions.

        Parameters
        ----------
        scene : Scene
            A mechanism without drivers and loads; the engine does not refuse it.
        function : str
            A name in ``differentiates_by``.
        away : ndarray, shape (nv,), optional
            Displacement from the start along unit velocities, which may open the loops.

        Returns
        -------
        OwnDerivatives or TangentDerivatives
            In the engine's coordinates, or along motions that the constraints allow.
        """

    def own_number_derivatives(
        self, scene: Scene, function: str, numbers: Sequence[str]
    ) -> np.ndarray | None:
        """Return the derivatives (6 nb, p) of the bodies' accelerations by numbers of the scene.

        Parameters
        ----------
        scene : Scene
            As of ``own_derivatives``.
        function : str
            A name in ``differentiates_by``.
        numbers : sequence of str
            Paths (p,) of masses and components of gravity, such as ``body[rod].mass``.

        Returns
        -------
        ndarray or None
            None, as of this method, if the function has no such derivatives.
        """
        return None
