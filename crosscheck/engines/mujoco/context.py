"""Addresses and numbers of a MuJoCo model that C functions in compiled code read.

A state consists of qpos and qvel. A driven coordinate has its prescribed value and rate. The armature of a
driven coordinate is so large that a generalised force causes the prescribed acceleration to rounding
accuracy.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import psutil

from crosscheck.engines.mujoco.struct_layout import offset
from mbref.scene import Driver

ARMATURE = 1e15  # armature of a driven coordinate / mean inertia of the model
LIBRARIES = ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll")
FUNCTIONS = (
    "mj_forward",
    "mj_fwdPosition",
    "mj_kinematics",
    "mj_comPos",
    "mj_makeConstraint",
    "mj_fullM",
    "mj_integratePos",
)
(
    FORWARD,
    POSITION_STAGE,
    KINEMATICS,
    CENTRES,
    CLOSURES,
    FULL_MASS,
    INTEGRATE,
    MODEL,
    DATA,
    QPOS,
    QVEL,
    QACC,
    FORCE,
    NQ,
    NV,
    SINGLE,
    SINGLES,
    TURN,
    TURNS,
    DRIVE,
    DRIVES,
    DRIVE_WIDTH,
    COUNT,
    RESIDUALS,
    JACOBIAN,
    WORK,
    MOST_ROWS,
    WEIGHTED,
    WIDTH,
) = range(29)  # indices in the context
# indices of the numbers of a driver
POSITION, VELOCITY, INERTIA, AMPLITUDE, FREQUENCY, PHASE, POLYNOMIAL = range(7)
ROWS = 7  # largest number of rows of an equality
NOTHING = 1e-12  # smaller entries of closure rows, relative to the model's extent, are rounding


class Context(NamedTuple):
    """The numbers that the C functions read, and the arrays to which they point."""

    numbers: np.ndarray
    quaternions: np.ndarray  # indices of quaternions in qpos
    kept: tuple[Any, ...]

    @property
    def address(self) -> int:
        """Return the address of the numbers."""
        return int(self.numbers.ctypes.data)


@functools.cache
def function(name: str) -> int:
    """Return the address of a function in MuJoCo's library."""
    import mujoco

    path = library(Path(mujoco.__file__).parent)
    return cast(int, ctypes.cast(getattr(ctypes.CDLL(str(path)), name), ctypes.c_void_p).value)


def library(package: Path) -> Path:
    """Return MuJoCo's library in the folder of its Python package, otherwise the library in this process.

    Raises FileNotFoundError, with the names and the folder, if there is none.
    """
    found = [path for pattern in LIBRARIES for path in sorted(package.glob(pattern))]
    own = psutil.Process()
    loaded = () if found or not hasattr(own, "memory_maps") else own.memory_maps()  # macOS has none
    places = map(Path, (part.path for part in loaded))
    found += [path for path in places if any(map(path.match, LIBRARIES))]
    if not found:
        raise FileNotFoundError(
            f"MuJoCo's library ({', '.join(LIBRARIES)}) is not in {package}; the families named 'compiled' "
            "call it. Reinstall the package mujoco, or use another family"
        )
    return found[0]


def context(
    model: Any, data: Any, drivers: Sequence[tuple[int, Driver]], is_weighted: bool = True
) -> Context:
    """Return the context of a model; ``drivers`` are joints of the model with their motions.

    Closures are satisfied by the least change of the velocities, measured by kinetic energy if
    ``is_weighted``.
    """
    single, turn = (np.array(pairs, dtype=np.int64).reshape(-1, 2) for pairs in _coordinates(model))
    drives, most = _drives(model, drivers), ROWS * model.neq
    work = np.zeros(most * (model.nv + 1) + model.nv * (model.nv + 2) + 1)
    work[-1] = NOTHING * max(1.0, model.stat.extent)
    state = (data.qpos, data.qvel, data.qacc, data.qfrc_applied)
    numbers = [
        *map(function, FUNCTIONS),
        model._address,
        data._address,
        *map(_address, state),
        model.nq,
        model.nv,
        _address(single),
        len(single),
        _address(turn),
        len(turn),
        _address(drives),
        *drives.shape,
        *(data._address + offset(field) for field in ("ne", "efc_pos", "efc_J")),
        _address(work),
        most,
        is_weighted,
    ]
    kept = (model, data, single, turn, drives, work)
    return Context(np.array(numbers, dtype=np.int64), turn[:, 0].copy(), kept)


def _address(array: np.ndarray) -> int:
    return int(array.ctypes.data)


def _coordinates(model: Any) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return indices in qpos and qvel of coordinates with a rate, and of quaternions with an angular
    velocity."""
    import mujoco

    kinds, single, turn = mujoco.mjtJoint, [], []
    for kind, q, v in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True):
        if kind == kinds.mjJNT_BALL:
            turn.append((q, v))
        elif kind == kinds.mjJNT_FREE:
            single += [(q + i, v + i) for i in range(3)]
            turn.append((q + 3, v + 3))
        else:
            single.append((q, v))
    return single, turn


def _drives(model: Any, drivers: Sequence[tuple[int, Driver]]) -> np.ndarray:
    """Return a row of numbers for each driver, and set the armature of its coordinate."""
    inertia = ARMATURE * model.stat.meaninertia
    width = max((len(driver.polynomial) for _, driver in drivers), default=0)
    table = np.zeros((len(drivers), POLYNOMIAL + width))
    for row, (joint, driver) in zip(table, drivers, strict=True):
        row[POSITION], row[VELOCITY] = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        model.dof_armature[model.jnt_dofadr[joint]] = row[INERTIA] = inertia
        if sine := driver.sine:
            row[AMPLITUDE : PHASE + 1] = sine.amplitude, sine.frequency, sine.phase
        row[POLYNOMIAL : POLYNOMIAL + len(driver.polynomial)] = driver.polynomial
    return table
