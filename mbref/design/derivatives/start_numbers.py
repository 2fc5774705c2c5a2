"""Numbers of the start that are no field of a scene: coordinates of joints at t = 0, and their rates."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from mbref.design.derivatives.columns import Columns
from mbref.design.derivatives.states import Direction, States
from mbref.design.derivatives.tangents import (
    MASSLESS,
    TangentRows,
    partition_of,
    tangents_at,
    with_accelerations,
)
from mbref.equations.model import Model
from mbref.input_error import InputError
from mbref.motions.motion import Motion

LABEL = re.compile(r"joint\[([^\]]+)\]\.(angle|displacement|rate|displacement_rate)\(0\)")
# change of a joint's coordinate (rad or lengths) by a unit motion of the freedoms, below which it is at rest
COORDINATE_AT_REST = 1e-9


class StartNumber(NamedTuple):
    """Changes x and v (n,) of the start by a joint's coordinate or rate at t = 0, SI units."""

    label: str
    x: np.ndarray
    v: np.ndarray


def is_of_start(label: str) -> bool:
    """Return whether a label names a number of the start."""
    return LABEL.fullmatch(label) is not None


def start_number(label: str, motion: Motion, model: Model, state: States, step: float) -> StartNumber:
    """Return the number of the start with a label such as ``joint[A].angle(0)``.

    ``state`` is the state at t = 0. Raises InputError for a joint without this coordinate, or a joint that
    cannot move.
    """
    name, quantity = LABEL.findall(label)[0]
    coordinate = {"rate": "angle", "displacement_rate": "displacement"}.get(quantity, quantity)
    column = f"{name}.{coordinate}"
    if column not in motion.columns():
        raise InputError(f"{label}: the scene has no joint {name!r} with this coordinate")
    rows = TangentRows(model, state, partition_of(model, state))
    state = with_accelerations(state, rows)
    f, units = rows.basis.shape[2], model.units
    if not f:
        raise InputError(f"{label}: drivers prescribe the whole motion, also at the start")
    each = tangents_at(model, state, rows, [])
    x, v = each.x[0] * units[:, None], each.v[0] * units[:, None]
    columns, none = Columns(motion, [column], step), np.zeros((1, model.m))
    still = np.zeros((1, model.n))
    gradient = np.array(
        [columns.along(model, state, Direction(x[None, :, j], still, still, none))[0][0, 0] for j in range(f)]
    )
    size = np.linalg.norm(each.x[0, :, :f], axis=0) * (model.length if coordinate == "displacement" else 1.0)
    if not (np.abs(gradient) > COORDINATE_AT_REST * size).any():
        raise InputError(f"{label}: drivers or other joints keep joint {name!r} from moving at the start")
    mass = rows.terms.mass
    basis = v[:, f:]
    inverse = np.linalg.pinv(basis.T @ (mass[:, None] * basis), rcond=MASSLESS, hermitian=True)
    along = inverse @ gradient / (gradient @ inverse @ gradient)
    if quantity != coordinate:
        return StartNumber(label, np.zeros(model.n), basis @ along)
    carried = v[:, :f] @ along
    return StartNumber(label, x[:, :f] @ along, carried - basis @ (inverse @ (basis.T @ (mass * carried))))
