"""Trajectory, Outcome and Cost: what every engine and every method returns."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np


class Outcome(enum.Enum):
    """How a run ended; ``letter`` is the footnote letter of the paper's tables, where it has one."""

    COMPLETED = ("COMPLETED", "", "reached the end time")
    SINGULAR_MATRIX = ("SINGULAR_MATRIX", "a", "the leading matrix is singular")
    NOT_CONVERGED = ("NOT_CONVERGED", "b", "the iteration did not converge")
    VIOLATION = ("VIOLATION", "c", "the constraint violation exceeds the allowed tolerance")
    STEP_FAILED = ("STEP_FAILED", "d", "the integrator could not take a step")
    NOT_FINITE = ("NOT_FINITE", "", "the state is not finite")
    UNDECIDED = ("UNDECIDED", "", "the branch of the motion cannot be told at a singular position")
    LEFT_MOTION = ("LEFT_MOTION", "", "the run went on along another motion than the one of its start")
    TIMED_OUT = ("TIMED_OUT", "", "the time limit was reached")
    CRASHED = ("CRASHED", "", "the process ended without a result")

    def __init__(self, label: str, letter: str, sentence: str):
        self.label = label
        self.letter = letter
        self.sentence = sentence


@dataclass(frozen=True)
class Cost:
    """Cost of a run: process CPU seconds of the stepping alone, build apart, and counts."""

    seconds: float = 0.0
    build_seconds: float = 0.0
    steps: int = 0
    rejected: int = 0
    rhs: int = 0
    factorisations: int = 0
    newton: int = 0


@dataclass(frozen=True)
class Crossing:
    """A singular position that a run passed at a time (s), and the branches of motion that meet there.

    ``position`` (nb, 3), m, and ``orientation`` (nb, 4) of the bodies; ``velocity`` and ``angular_velocity``
    (b, nb, 3), world, on each of the b branches to second order, the smooth one first.  The run took
    branch ``taken``, counted from 1; ``sentence`` says how many there are, or why they cannot be told.
    """

    time: float
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    taken: int
    sentence: str

    def instants(self, end: float, count: int) -> np.ndarray:
        """Times (count,), s, at which its branches are seen to part, of a run from 0 to ``end``.

        From a quarter turn of the fastest body before the crossing to not quite half a turn after it, where
        the next crossing often is; all of the run where no body turns.
        """
        rate = float(np.linalg.norm(self.angular_velocity, axis=-1).max(initial=0.0))
        if not rate:
            return np.linspace(0.0, end, count)
        turn = 2 * math.pi / rate
        return np.linspace(max(0.0, self.time - 0.25 * turn), min(end, self.time + 0.45 * turn), count)

    def to_record(self) -> dict[str, Any]:
        """The crossing as numbers, lists and text."""
        arrays = ("position", "orientation", "velocity", "angular_velocity")
        return {
            "time": self.time, "taken": self.taken, "sentence": self.sentence,
            **{key: getattr(self, key).tolist() for key in arrays},
        }  # fmt: skip

    @staticmethod
    def from_record(record: Mapping[str, Any]) -> Crossing:
        """The crossing that a record was made of."""
        arrays = {key: np.array(v, dtype=float) for key, v in record.items() if isinstance(v, list)}
        return Crossing(**{**record, **arrays})


@dataclass(frozen=True)
class BodyMotion:
    """One body's share of a trajectory: the rows (k, …) of its arrays, in the same frames and units."""

    name: str
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray | None
    angular_acceleration: np.ndarray | None

    def __repr__(self) -> str:
        return f"<BodyMotion of {self.name!r}: {len(self.position)} samples>"


PER_BODY = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")


@dataclass(frozen=True, repr=False)
class Trajectory:
    """Poses of every body at the caller's times, as far as the run got.

    With k times reached and nb bodies: ``position`` (k, nb, 3) of the centres of mass, ``velocity``,
    ``angular_velocity`` (k, nb, 3), all in the world frame; ``orientation`` (k, nb, 4) unit
    quaternions (w, x, y, z), body to world.  ``acceleration`` and ``angular_acceleration``
    (k, nb, 3, world) and ``reactions`` are None where the engine does not give them.
    ``reactions[joint]`` (k, 6) is the force and the moment (world) on the joint's second body at the
    anchor on that body, the driver's share included.  ``open_reactions[joint]`` (k,) counts the dimensions of
    it that equilibrium does not determine, because of redundant rows or at a singular position; None where
    that is not known.  ``crossings`` are the singular positions passed; None
    where the engine, or the method, does not look for them.
    """

    scene: str
    engine: str
    version: str
    method: str
    settings: Mapping[str, Any]
    times: np.ndarray
    bodies: tuple[str, ...]
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray | None = None
    angular_acceleration: np.ndarray | None = None
    reactions: Mapping[str, np.ndarray] | None = None
    outcome: Outcome = Outcome.COMPLETED
    t_end: float = 0.0
    message: str = ""
    cost: Cost = field(default_factory=Cost)
    crossings: Sequence[Crossing] | None = None
    open_reactions: Mapping[str, np.ndarray] | None = None

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} of {self.scene!r} by {self.engine} {self.method}: {self.outcome.label}, "
            f"{len(self.times)} samples to t = {self.t_end:g} s>"
        )

    def __getitem__(self, name: str) -> BodyMotion:
        """The motion of the body of that name; raises KeyError that lists the bodies."""
        if name not in self.bodies:
            raise KeyError(f"no body {name!r}; bodies: {', '.join(self.bodies)}")
        b = self.bodies.index(name)
        rows: dict[str, Any] = {
            key: None if (array := getattr(self, key)) is None else array[:, b] for key in PER_BODY
        }
        return BodyMotion(name, **rows)

    @staticmethod
    def failed(
        *, scene: str, engine: str, version: str, method: str, settings: Mapping[str, Any],
        bodies: tuple[str, ...], outcome: Outcome, message: str,
    ) -> Trajectory:  # fmt: skip
        """A trajectory without a single state: a run that crashed, hung or never began."""
        nb = len(bodies)
        return Trajectory(
            scene, engine, version, method, settings, np.zeros(0), bodies, np.zeros((0, nb, 3)),
            np.zeros((0, nb, 4)), np.zeros((0, nb, 3)), np.zeros((0, nb, 3)),
            outcome=outcome, message=message,
        )  # fmt: skip

    def to_record(self) -> dict[str, Any]:
        """The record that ``run --json`` prints (its ``metrics`` are added by crosscheck)."""
        per_body = [key for key in PER_BODY if getattr(self, key) is not None]
        return {
            "engine": self.engine,
            "version": self.version,
            "method": self.method,
            "settings": dict(self.settings),
            "outcome": self.outcome.label,
            "message": self.message,
            "t_end": float(self.t_end),
            "times": self.times.tolist(),
            "bodies": {
                name: {key: getattr(self, key)[:, b].tolist() for key in per_body}
                for b, name in enumerate(self.bodies)
            },
            "reactions": _lists(self.reactions or {}),
            "open_reactions": None if self.open_reactions is None else _lists(self.open_reactions),
            "crossings": None if self.crossings is None else [c.to_record() for c in self.crossings],
            "metrics": {},
            "cost": {f.name: getattr(self.cost, f.name) for f in fields(Cost)},
        }

    @staticmethod
    def from_record(scene: str, record: Mapping[str, Any]) -> Trajectory:
        """The trajectory a record was made of."""
        names = tuple(record["bodies"])
        k, crossings, marks = len(record["times"]), record.get("crossings"), record.get("open_reactions")

        def stacked(key: str, width: int) -> np.ndarray:
            rows = [record["bodies"][name][key] for name in names]
            return np.array(rows, dtype=float).reshape(len(names), k, width).transpose(1, 0, 2)

        def optional(key: str) -> np.ndarray | None:
            given = all(record["bodies"][name].get(key) is not None for name in names)
            return stacked(key, 3) if given else None

        reactions = {n: np.array(v, dtype=float).reshape(k, 6) for n, v in record["reactions"].items()}
        return Trajectory(
            scene=scene,
            **{key: record[key] for key in ("engine", "version", "method", "settings", "message", "t_end")},
            times=np.array(record["times"], dtype=float),
            bodies=names,
            position=stacked("position", 3),
            orientation=stacked("orientation", 4),
            velocity=stacked("velocity", 3),
            angular_velocity=stacked("angular_velocity", 3),
            acceleration=optional("acceleration"),
            angular_acceleration=optional("angular_acceleration"),
            reactions=reactions or None,
            open_reactions=None if marks is None else {n: np.array(v, dtype=int) for n, v in marks.items()},
            outcome=Outcome[record["outcome"]],
            cost=Cost(**record["cost"]),
            crossings=None if crossings is None else tuple(Crossing.from_record(c) for c in crossings),
        )


def _lists(arrays: Mapping[str, np.ndarray]) -> dict[str, list[Any]]:
    """Arrays by name as lists."""
    return {name: np.asarray(array).tolist() for name, array in arrays.items()}
