"""Trajectory, Outcome and Cost: the result of a run of any engine or method."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from mbref.motions.crossing import Crossing
from mbref.motions.event import Event
from mbref.motions.record_fields import arrays, typed


class Outcome(enum.Enum):
    """Outcome of a run.

    Attributes
    ----------
    label : str
        The name, as in records: ``"COMPLETED"``.
    letter : str
        The footnote letter of Tables I to III of Neto & Ambrósio (2003), or an empty string.
    sentence : str
        What the outcome means.
    """

    COMPLETED = ("COMPLETED", "", "reached the end time")
    SINGULAR_MATRIX = ("SINGULAR_MATRIX", "a", "the leading matrix is singular")
    NOT_CONVERGED = ("NOT_CONVERGED", "b", "the iteration did not converge")
    VIOLATION = ("VIOLATION", "c", "the constraint violation exceeds the allowed tolerance")
    STEP_FAILED = ("STEP_FAILED", "d", "the integrator could not take a step")
    NOT_FINITE = ("NOT_FINITE", "", "the state is not finite")
    SINGULAR_POSITION = (
        "SINGULAR_POSITION",
        "",
        "the motion reaches a singular position, which the method does not cross",
    )
    UNDECIDED = ("UNDECIDED", "", "rounding errors would decide the motion beyond a singular position")
    LEFT_MOTION = ("LEFT_MOTION", "", "the run left the exact motion, by another branch or by drift")
    TIMED_OUT = ("TIMED_OUT", "", "the time limit was reached")
    CRASHED = ("CRASHED", "", "the process ended without a result")

    def __init__(self, label: str, letter: str, sentence: str):
        self.label = label
        self.letter = letter
        self.sentence = sentence


@dataclass(frozen=True)
class Cost:
    """Cost of a run.

    Attributes
    ----------
    seconds : float
        Process CPU time of the stepping alone, s; in a scene with events also of locating them.
    build_seconds : float
        CPU time of everything before the first step, s.
    steps, rejected : int
        Accepted and rejected steps.
    rhs, factorisations, newton : int
        Evaluations of the accelerations, matrix factorisations, and Newton iterations.
    """

    seconds: float = 0.0
    build_seconds: float = 0.0
    steps: int = 0
    rejected: int = 0
    rhs: int = 0
    factorisations: int = 0
    newton: int = 0


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """Motion of one body at k sample times, in the frames and units of Trajectory.

    Attributes
    ----------
    name : str
        Name of the body.
    position, velocity, angular_velocity : ndarray, shape (k, 3)
        Centre of mass (m) and velocities (m/s, rad/s), world frame.
    orientation : ndarray, shape (k, 4)
        Unit quaternions (w, x, y, z), body to world.
    acceleration, angular_acceleration : ndarray, shape (k, 3), or None
        World frame, m/s² and rad/s². None if the engine does not give them.
    """

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


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """Poses of all bodies at the sample times that a run reached.

    It behaves as a dictionary of the bodies' motions by name: ``motion["rod"]``, ``"rod" in motion``,
    ``for name in motion``, ``len(motion)``. Two trajectories are equal if they are one object.
    k sample times were reached, the scene has nb bodies, and all vectors are in the world frame.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Sample times, s.
    bodies : tuple of str
        Names of the bodies, in the order of the arrays.
    position, velocity, angular_velocity : ndarray, shape (k, nb, 3)
        Centres of mass (m) and velocities (m/s, rad/s).
    orientation : ndarray, shape (k, nb, 4)
        Unit quaternions (w, x, y, z), body to world.
    acceleration, angular_acceleration : ndarray, shape (k, nb, 3), or None
        m/s² and rad/s². None if the engine does not give them.
    reactions : mapping of str to ndarray, shape (k, 6), or None
        By joint: force (N) and moment (N m) on the second body at its anchor, including the driver's.
    open_reactions : mapping of str to ndarray, shape (k,), or None
        By joint: number of reaction components that equilibrium does not determine, because of redundant
        constraint rows or at a singular position. By ``driver(A)``: 1 where it does not determine the force
        or torque of a driver.
    angles : mapping of str to ndarray, shape (k,), or None
        By joint that turns about one axis: angle since t = 0, rad, with full turns as the run counted them.
        None if the engine does not count turns.
    crossings : sequence of Crossing, or None
        Singular positions that the run crossed, or the one at which it ended. None if the method or engine
        does not look for them.
    events : tuple of Event, or None
        Times at which constraints begin or cease to hold. None if constraints always hold.
    outcome : Outcome
        How the run ended.
    t_end : float
        Time that the run reached, s.
    message : str
        One sentence on the end of the run.
    cost : Cost
        CPU time and counts.
    scene, engine, version, method : str
        Names of the scene, the engine, its version, and the method or family of settings.
    settings : mapping
        Numbers of the method or engine that reproduce the run.
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
    angles: Mapping[str, np.ndarray] | None = None
    events: tuple[Event, ...] | None = None

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} of {self.scene!r} by {self.engine} {self.method}: {self.outcome.label}, "
            f"{len(self.times)} samples to t = {self.t_end:g} s>"
        )

    def __len__(self) -> int:
        """Return the number of bodies; ``times.size`` is the number of samples."""
        return len(self.bodies)

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the bodies, as a dictionary does."""
        return iter(self.bodies)

    def __contains__(self, name: object) -> bool:
        """Return whether a body has this name."""
        return name in self.bodies

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that an interactive shell offers in brackets."""
        return list(self.bodies)

    def __getitem__(self, name: str) -> BodyMotion:
        """Return the motion of one body.

        Raises
        ------
        KeyError
            If no body has this name; the message lists the bodies.
        """
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
        """Return a trajectory without states, for a run that crashed, hung or did not begin.

        Parameters
        ----------
        scene, engine, version, method : str
            Names of the scene, the engine, its version, and the method or family of settings.
        settings : mapping
            Numbers of the method or engine.
        bodies : tuple of str
            Names of the scene's bodies.
        outcome, message : Outcome and str
            How the run ended, and one sentence on its end.

        Returns
        -------
        Trajectory
            With k = 0 samples.
        """
        nb = len(bodies)
        return Trajectory(
            scene, engine, version, method, settings, np.zeros(0), bodies, np.zeros((0, nb, 3)),
            np.zeros((0, nb, 4)), np.zeros((0, nb, 3)), np.zeros((0, nb, 3)),
            outcome=outcome, message=message,
        )  # fmt: skip

    def to_record(self) -> dict[str, Any]:
        """Return the record that ``run --json`` prints. crosscheck adds its ``metrics``.

        Returns
        -------
        dict
            Numbers in the units of the attributes, lists and text, for JSON; states by body.
        """
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
            "angles": None if self.angles is None else _lists(self.angles),
            "crossings": None if self.crossings is None else [c.to_record() for c in self.crossings],
            "events": None if self.events is None else [event.to_record() for event in self.events],
            "metrics": {},
            "cost": {f.name: getattr(self.cost, f.name) for f in fields(Cost)},
        }

    @staticmethod
    def from_record(scene: str, record: Mapping[str, Any]) -> Trajectory:
        """Return the trajectory of a record that ``to_record`` wrote.

        Parameters
        ----------
        scene : str
            Name of the scene, which the record does not contain.
        record : mapping
            Result of ``to_record``; another mapping raises one of ``mbref.records.BROKEN``.

        Returns
        -------
        Trajectory
            The trajectory, with arrays as attributes.
        """
        names, k = tuple(record["bodies"]), len(record["times"])
        crossings, events = record.get("crossings"), record.get("events")

        def stacked(key: str, width: int) -> np.ndarray:
            rows = [record["bodies"][name][key] for name in names]
            return np.array(rows, dtype=float).reshape(len(names), k, width).transpose(1, 0, 2)

        def optional(key: str) -> np.ndarray | None:
            given = all(record["bodies"][name].get(key) is not None for name in names)
            return stacked(key, 3) if given else None

        found = Trajectory(
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
            reactions=arrays(record["reactions"], (k, 6), float) or None,
            open_reactions=arrays(record.get("open_reactions"), (k,), int),
            angles=arrays(record.get("angles"), (k,), float),
            outcome=Outcome[record["outcome"]],
            cost=typed(Cost(**record["cost"])),
            crossings=None if crossings is None else tuple(Crossing.from_record(c) for c in crossings),
            events=None if events is None else tuple(map(Event.from_record, events)),
        )
        return typed(found)


def _lists(arrays: Mapping[str, np.ndarray]) -> dict[str, list[Any]]:
    """Return arrays by name as lists."""
    return {name: np.asarray(array).tolist() for name, array in arrays.items()}
