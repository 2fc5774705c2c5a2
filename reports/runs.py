"""Runs as the sections of a report read them, made from stored records, and their groups by scene."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from crosscheck.judge.full_turns import counted_poses
from crosscheck.judge.metrics import exact_motion
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.tolerances import ERROR_LEVELS, EXCESS, FALSE_SUCCESS
from crosscheck.judge.truth import NoSolution, Truth, truth_for
from crosscheck.study.fair_timing import force_differences, model_difference, model_differences
from crosscheck.study.grid import Record
from crosscheck.study.record_view import drawn, error_text, varied_settings
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.records import RecordsError
from mbref.scene import Scene

LEVELS, WRONG = ERROR_LEVELS, FALSE_SUCCESS
Curve = tuple[str, str]  # engine, family


@dataclass(frozen=True)
class Run:
    """One record of the study; ``error`` is NaN if there is no truth."""

    record: Record

    @property
    def scene(self) -> str:
        return self.record["scene"]

    @property
    def curve(self) -> Curve:
        return self.record["engine"], self.record["family"]

    @property
    def label(self) -> str:
        return " ".join(self.curve)

    @property
    def outcome(self) -> Outcome:
        return Outcome[self.record["outcome"]]

    @property
    def completed(self) -> bool:
        return self.outcome is Outcome.COMPLETED

    @property
    def t_end(self) -> float:
        return self.record["t_end"]

    @property
    def reason(self) -> str:
        """Return the reason of the run's end in one sentence: the engine's message, or a sentence on the
        outcome."""
        return self.record["message"] or self.outcome.sentence

    @property
    def seconds(self) -> float:
        return self.record["cost"]["seconds"]

    @property
    def error(self) -> float:
        return self.metric("error")

    @property
    def estimate(self) -> float:
        """Return the largest error that the engine itself estimates; NaN if it makes no estimate."""
        largest = (self.record.get("error_estimate") or {}).get("largest")
        return math.nan if largest is None else float(largest)

    @property
    def drawn(self) -> tuple[float, float]:
        """Return error and time (s) for logarithmic axes; the error is at least the bound on the truth's own
        error."""
        return drawn(self.record, self.seconds)

    @property
    def by_error(self) -> tuple[bool, float]:
        """Return the key that sorts runs by their error; unknown errors come last."""
        return math.isnan(self.error), self.error

    @property
    def said(self) -> str:
        """Return the error for a table cell: ``< 3e-12`` if it is below the bound on the truth's error."""
        return error_text(self.record)

    @property
    def is_false_success(self) -> bool:
        """Return whether the run reports that it completed although its grade is WRONG."""
        return self.completed and self.error > WRONG

    @property
    def is_short_of_tolerance(self) -> bool:
        """Return whether the run reports that it completed although its error exceeds EXCESS times its
        relative tolerance, if the setting has a tolerance."""
        rtol = self.record["settings"].get("rtol", math.inf)
        return self.completed and self.error > EXCESS * rtol

    def rate(self, count: str) -> float:
        """Return a cost of the record, such as ``steps``, per second of simulation; NaN if the record lacks
        this cost."""
        return float(self.record["cost"][count]) / self.t_end if self.t_end > 0 else math.nan

    def metric(self, name: str) -> float:
        """Return a metric of the record; NaN if the record lacks this metric."""
        value = self.record["metrics"].get(name)
        return math.nan if value is None else float(value)

    @cached_property
    def trajectory(self) -> Trajectory:
        record = f"records.jsonl: record {self.record['key'][:12]!r}"
        for field in ("bodies", "reactions"):
            if self.record.get(field) is None:
                raise RecordsError(f"{record}: {field}: field required by pictures")
        motion = Trajectory.from_record(self.scene, self.record)
        if len(motion.position) != len(motion.times) or not self.record["bodies"]:
            raise RecordsError(f"{record}: bodies: pictures require states of all bodies at all times")
        return motion


@dataclass(frozen=True)
class SceneRuns:
    """A scene and its runs, with all data that the sections on one scene need."""

    scene: Scene
    runs: Sequence[Run]
    gate: Sequence[Record] = ()  # short runs that show whether the engines simulate equal mechanisms
    truth: Record | None = None  # record made by `crosscheck.study.truths`
    motion: Record | None = None  # run of largest error, sampled at the frames of the truth's animation
    branches: Sequence[Record] = ()  # runs along the branches that meet at singular positions

    def difference(self) -> str | None:
        """Return the first quantity in which an engine's mechanism differs; None if all agree."""
        return model_difference(self.scene, self.gate, motions=self._records) if self.gate else None

    @property
    def _records(self) -> Sequence[Record]:
        """Return the records of the runs."""
        return [run.record for run in self.runs]

    @cached_property
    def differences(self) -> Mapping[str, str]:
        """Return for each engine that simulates another mechanism how it differs from the scene; empty
        without a truth."""
        if not (self.truth and self.truth["kind"]):
            return {}
        at_start = model_differences(self.scene, self.gate, motions=self._records) if self.gate else {}
        return at_start | force_differences(self.scene, self._records)

    def exact(self, times: np.ndarray) -> Trajectory | None:
        """Return the true motion at times (k,), computed within the CPU time that the truth's record used;
        None if unknown."""
        truth = self._truth()
        try:
            return None if truth is None else counted_poses(self.scene, truth, times)
        except NoSolution:
            return None

    def exact_part(self, motion: Trajectory) -> Trajectory | None:
        """Return the true motion at a motion's times, up to the time to which the truth is known."""
        return exact_motion(self.scene, motion, self._truth())

    def _truth(self) -> Truth | None:
        return truth_for(self.scene, SECONDS if self.truth is None else self.truth["given"])

    def curves(self) -> dict[Curve, list[Run]]:
        """Return the runs by engine and family, in the order of the records."""
        curves: dict[Curve, list[Run]] = {}
        for run in self.runs:
            curves.setdefault(run.curve, []).append(run)
        return curves

    def varied_settings(self, run: Run) -> str:
        """Return the settings that vary along a run's curve as text (``rtol=1e-06``); all settings if the run
        is alone."""
        return varied_settings(run.record, [other.record for other in self.runs])

    def completed(self) -> list[Run]:
        return [run for run in self.runs if run.completed]

    def best(self) -> dict[Curve, Run]:
        """Return for each curve the completed run of least error, otherwise the run that ended last."""
        return {curve: min(runs, key=_rank) for curve, runs in self.curves().items()}


def _rank(run: Run) -> tuple[bool, float, float]:
    error = run.error if math.isfinite(run.error) else math.inf
    return not run.completed, 0.0 if run.completed else -run.t_end, error


def by_scene(
    records: Iterable[Record],
    scenes: Mapping[str, Scene],
    gates: Iterable[Record] = (),
    truths: Iterable[Record] = (),
    motions: Iterable[Record] = (),
    branches: Iterable[Record] = (),
) -> list[SceneRuns]:
    """Return the runs grouped by scene, in the order of ``scenes``.

    Each group also has the scene's short runs (``gates``), its truth and its animated motions. Scenes without
    runs are left out.
    """
    runs, gate, along = (_of_scenes(found, scenes) for found in (records, gates, branches))
    truth, motion = ({record["scene"]: record for record in group} for group in (truths, motions))
    return [
        SceneRuns(
            scene, [Run(r) for r in runs[name]], gate[name], truth.get(name), motion.get(name), along[name]
        )
        for name, scene in scenes.items()
        if runs[name]
    ]


def _of_scenes(records: Iterable[Record], scenes: Collection[str]) -> dict[str, list[Record]]:
    """Return the records of every scene, in their order; records of other scenes are left out."""
    found: dict[str, list[Record]] = {name: [] for name in scenes}
    for record in records:
        if record["scene"] in found:
            found[record["scene"]].append(record)
    return found


def ended_briefly(run: Run) -> str:
    """Return ``20 s`` for a completed run of the paper, otherwise the end time with the footnote or the
    outcome's name."""
    return "20 s" if run.completed else f"{run.t_end:.4g} s {run.outcome.letter or run.outcome.label}"


def number(value: float, digits: int = 2) -> str:
    """Return a measured number for a table cell; an en dash if it is missing."""
    return "–" if not math.isfinite(value) else f"{value:.{digits}g}"


def ratio(value: float) -> str:
    """Return a ratio for a table cell."""
    return "–" if not math.isfinite(value) else f"{value:.1f}"


def short(level: float) -> str:
    """Return an error level as text: 1e-3."""
    return f"{level:.0e}".replace("e-0", "e-")


def power(value: float) -> str:
    """Return an error for a table cell: one decimal and a power of ten."""
    return "–" if not math.isfinite(value) else "0" if value == 0 else f"{value:.1e}"


ROUNDING = 1e-11  # smaller differences from the judge's solution are rounding


def beyond_rounding(value: float) -> str:
    """Return a difference for a table cell. Differences at rounding level vary between machines and are not
    printed."""
    return f"< {ROUNDING:g}" if 0 < value < ROUNDING else power(value)


def duration(seconds: float) -> str:
    """Return a duration in s, ms or µs."""
    if not math.isfinite(seconds):
        return "–"
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds * 1e6:.3g} µs"
