"""Cache of geometries: natural coordinates are computed once for scenes that differ in masses and loads.

Computing them takes longer than a short run.
"""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from mbref.equations.initial_state import Start
from mbref.equations.model import Model
from mbref.equations.reduction import reduced_start
from mbref.taylor.natural import NaturalCoordinates, pose_of
from mbref.taylor.numbers import OneScene
from mbref.taylor.polynomial_layout import Polynomials
from mbref.taylor.polynomials import Geometry

MOST_GEOMETRIES = 64  # largest number of cached geometries

_known: dict[Hashable, Geometry] = {}


def equations_of(model: Model, moving: bytes, driven: bool) -> tuple[Geometry, Polynomials]:
    """Return ``geometry_of`` a scene at its start, with ``moving`` as bytes, and the scene's polynomials."""
    start, *_ = reduced_start(model)
    found = geometry_of(model, start, np.frombuffer(moving, dtype=bool), driven)
    return found, found.polynomials(model)


def geometry_of(model: Model, start: Start, moving: np.ndarray, driven: bool) -> Geometry:
    """Return the geometry of a scene at its start, for which these velocities (n,) can be nonzero.

    ``driven`` is True for kinematics, when drivers prescribe the whole motion.
    """
    key = driven, _key(model, start, moving)
    found = _known.get(key)  # looked up once, because hashing joints takes time
    if found is None:
        if len(_known) >= MOST_GEOMETRIES:
            _known.pop(next(iter(_known)), None)
        pose = pose_of(start.q)
        found = _known[key] = Geometry(NaturalCoordinates(model, pose, moving, driven, OneScene()))
    return found


def _key(model: Model, start: Start, moving: np.ndarray) -> Hashable:
    """Return all numbers and joints on which the geometry depends."""
    numbers = (start.q, moving, model.start(), model.principal, *model.data.primitives)
    return model.structure, model.joints, model.length, *(array.tobytes() for array in numbers)
