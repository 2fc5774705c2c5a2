"""Pinocchio without Python between samples: ``constraintDynamics`` of its C++ library in the compiled DOP853.

States may be projected onto the closures.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, cast

import numpy as np

from crosscheck.engines.pinocchio import library
from crosscheck.engines.pinocchio.model import DRIVEN_ARMATURE, Loads, Mechanism
from crosscheck.engines.shared.sampling import Sample
from crosscheck.engines.shared.spanning_tree import BALL_JOINT, FREE, SLIDE, TURN
from mbref.motions.trajectory import Trajectory
from mbref.scene import Driver, Scene

KINDS = {TURN: 0, SLIDE: 1, BALL_JOINT: 2, FREE: 3}
QUATERNION = {BALL_JOINT: 0, FREE: 3}  # index of the quaternion in the coordinates of a joint


class Solver(NamedTuple):
    """Parameters of Pinocchio's constraint solver."""

    accuracy: float
    mu: float
    iterations: int
    beta: float  # decay rate of the closure errors, a double root, 1/s
    nothing: float  # entries of the closure Jacobian below this size are rounding


def why_not(scene: Scene) -> str:
    """Return the reason why the compiled families cannot run a scene, in a sentence; empty if they can."""
    if reason := library.why_not():
        return reason
    for load in Loads(Mechanism(scene)).evaluated:
        return f"load[{scene.load.index(load)}] of type {load.type!r} is not mapped to compiled code"
    return ""


def prepare() -> None:
    """Compile the integrator and the library, or load them from their caches; raises NoLibrary."""
    from crosscheck.engines.shared.compiled import run

    run.prepare()
    library.library()


class CompiledRun:
    """A mechanism in the compiled library, and its state at t = 0."""

    def __init__(self, mechanism: Mechanism, loads: Loads, solver: Solver):
        self.mechanism, self._library = mechanism, library.library()
        self._address = self._opened(loads, solver)
        weakref.finalize(self, self._library.close_mechanism, self._address)
        model = mechanism.model
        for place, driver in mechanism.driven:
            drive = _drive(mechanism.q_of_v[place], place, driver)
            polynomial = np.array(driver.polynomial, dtype=float)
            self._library.add_drive(
                self._address, _pointer(drive), ctypes.c_int64(len(polynomial)), _pointer(polynomial)
            )
        for iq, iv, spring in loads.joint_springs:
            twist = np.array([iq, iv, spring.stiffness, spring.natural, spring.damping], dtype=float)
            self._library.add_twist(self._address, _pointer(twist))
        joints = zip(mechanism.motions, list(model.joints)[1:], strict=True)
        places = [joint.idx_q + QUATERNION[m.kind] for m, joint in joints if m.kind in QUATERNION]
        self.quaternions = np.array(places, dtype=np.int64)

    def _opened(self, loads: Loads, solver: Solver) -> ctypes.c_void_p:
        mechanism = self.mechanism
        tables = (
            _joints(mechanism),
            _closures(mechanism),
            np.array(mechanism.scene.gravity, dtype=float),
            loads.constant.copy(),
            mechanism.model.armature.copy(),
            np.array(solver, dtype=float),
        )
        counts = np.array([len(tables[0]), len(tables[1])], dtype=np.int64)
        self._library.open_mechanism.restype = ctypes.c_void_p
        address = self._library.open_mechanism(_pointer(counts), *map(_pointer, tables))
        if not address:
            raise ValueError(
                f"{mechanism.scene.name}: Pinocchio's C++ library cannot build the mechanism; "
                "a family without 'compiled' prints its reason"
            )
        return ctypes.c_void_p(address)

    def trajectory(
        self,
        times: np.ndarray,
        options: Mapping[str, float],
        is_projected: bool,
        longest: float,
        load: Callable[[float, np.ndarray], None],
        sample: Callable[[float], Sample],
        built: float,
        labels: dict[str, Any],
    ) -> Trajectory:
        """Return the motion; ``load`` puts a state at its time into the data, and construction took ``built``
        seconds."""
        from crosscheck.engines.shared.compiled.dop853 import System
        from crosscheck.engines.shared.compiled.run import MOST_STEPS, trajectory

        rtol, settle = options["rtol"], self._function("settle") if is_projected else 0
        system = System(
            self._function("rates"),
            cast(int, self._address.value),
            self.quaternions,
            rtol,
            rtol,
            options["min_step"],
            longest,
            MOST_STEPS,
            settle,
        )
        start = np.concatenate((self.mechanism.q0, self.mechanism.v0))
        return trajectory(self.mechanism.scene, times, system, start, load, sample, built, labels)

    def _function(self, name: str) -> int:
        return cast(int, ctypes.cast(getattr(self._library, name), ctypes.c_void_p).value)


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def _joints(mechanism: Mechanism) -> np.ndarray:
    """Return a row of 21 numbers for each joint, as ``rates.cpp`` reads them."""
    model, rows = mechanism.model, []
    for j, motion in enumerate(mechanism.motions, 1):
        inertia = model.inertias[j]
        place = model.jointPlacements[j].translation
        rows.append(
            [
                KINDS[motion.kind],
                model.parents[j],
                *motion.axis,
                *place,
                inertia.mass,
                *inertia.lever,
                *inertia.inertia.ravel(),
            ]
        )
    return np.array(rows, dtype=float).reshape(-1, 21)


def _closures(mechanism: Mechanism) -> np.ndarray:
    """Return a row of 9 numbers for each closure."""
    rows = [
        [
            6 if closure.type == mechanism.pin.ContactType.CONTACT_6D else 3,
            closure.joint1_id,
            closure.joint2_id,
            *closure.joint1_placement.translation,
            *closure.joint2_placement.translation,
        ]
        for closure in mechanism.closures
    ]
    return np.array(rows, dtype=float).reshape(-1, 9)


def _drive(iq: int, iv: int, driver: Driver) -> np.ndarray:
    """Return the six numbers of a driver that precede the coefficients of its polynomial."""
    wave = (0.0, 0.0, 0.0)
    if sine := driver.sine:
        wave = (sine.amplitude, sine.frequency, sine.phase)
    return np.array([iq, iv, DRIVEN_ARMATURE, *wave], dtype=float)
