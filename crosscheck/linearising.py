"""The interface of engines that have a function of their own for eigenvalues of small motions."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from mbref.scene import Scene


class Linearising(ABC):
    """Interface that an engine's adapter implements beside ``Engine`` if the engine linearises.

    Attributes
    ----------
    linearises_by : str
        Name of the engine's function.
    """

    linearises_by: str

    @abstractmethod
    def own_eigenvalues(self, scene: Scene) -> np.ndarray:
        """Return eigenvalues of small motions about the scene's own pose by the engine's function.

        Parameters
        ----------
        scene : Scene
            The mechanism at an equilibrium, with drivers that stand still.

        Returns
        -------
        ndarray, shape (k,), complex
            Exponents s (1/s) of motions exp(s t).
        """
