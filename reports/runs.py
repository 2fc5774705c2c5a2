"""Run: a stored record as the sections read it, and the groupings they share."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from crosscheck.judge.metrics import exact_motion
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.tolerances import ERROR_LEVELS, EXCESS, FALSE_SUCCESS
from crosscheck.judge.truth import NoSolution, Truth, truth_for
from crosscheck.study.fair_timing import force_differences, model_difference, model_differences
from crosscheck.study.grid import Record
from crosscheck.study.record_view import drawn, error_text, varied_settings
from mbref.scene import Scene
from mbref.trajectory import Outcome, Trajectory

LEVELS, WRONG = ERROR_LEVELS, FALSE_SUCCESS
Curve = tuple[str, str]  # engine, family


@dataclass(frozen=True)
class Run:
    """One record of the study. ``error`` is NaN where no truth could be compared with."""

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
        """The reason of the end, one sentence: the engine's, else the outcome's."""
        return self.record["message"] or self.outcome.sentence

    @property
    def seconds(self) -> float:
        return self.record["cost"]["seconds"]

    @property
    def error(self) -> float:
        return self.metric("error")

    @property
    def drawn(self) -> tuple[float, float]:
        """Error and time (s) on logarithmic axes; the error no lower than it is known."""
        return drawn(self.record, self.seconds)

    @property
    def by_error(self) -> tuple[bool, float]:
        """Return the key that sorts runs by their error; unknown errors come last."""
        return math.isnan(self.error), self.error

    @property
    def said(self) -> str:
        """The error for a table cell: ``< 3e-12`` below the bound on the truth's own error."""
        return error_text(self.record)

    @property
    def is_false_success(self) -> bool:
        """Whether the run says it completed and yet is WRONG."""
        return self.completed and self.error > WRONG

    @property
    def is_short_of_tolerance(self) -> bool:
        """Whether the run says it completed and has EXCESS times the error it was asked for, if it was."""
        rtol = self.record["settings"].get("rtol", math.inf)
        return self.completed and self.error > EXCESS * rtol

    def rate(self, count: str) -> float:
        """A cost of the record, such as ``steps``, a second of simulation; NaN for a run without any."""
        return float(self.record["cost"][count]) / self.t_end if self.t_end > 0 else math.nan

    def metric(self, name: str) -> float:
        """A metric of the record; NaN where it has none."""
        value = self.record["metrics"].get(name)
        return math.nan if value is None else float(value)

    @cached_property
    def trajectory(self) -> Trajectory:
        return Trajectory.from_record(self.scene, self.record)


@dataclass(frozen=True)
class SceneRuns:
    """A scene and its runs: what the sections about one scene are given."""

    scene: Scene
    runs: Sequence[Run]
    gate: Sequence[Record] = ()  # short runs that show whether the engines simulate the same mechanism
    truth: Record | None = None  # record made by `crosscheck.study.truths`
    motion: Record | None = None  # the run of largest error at the instants shown of the truth's motion
    branches: Sequence[Record] = ()  # runs along the branches that meet at singular positions

    def difference(self) -> str | None:
        """The first field in which an engine's mechanism is another one; None when all agree."""
        return model_difference(self.scene, self.gate) if self.gate else None

    @cached_property
    def differences(self) -> Mapping[str, str]:
        """By engine, how the mechanism that it simulates differs from the scene; empty without a truth."""
        if not (self.truth and self.truth["kind"]):
            return {}
        at_start = model_differences(self.scene, self.gate) if self.gate else {}
        return at_start | force_differences(self.scene, [run.record for run in self.runs])

    def exact(self, times: np.ndarray) -> Trajectory | None:
        """The true motion at times (k,), in the time that its record was given; None where unknown."""
        truth = self._truth()
        try:
            return None if truth is None else truth.poses(times)
        except NoSolution:
            return None

    def exact_part(self, motion: Trajectory) -> Trajectory | None:
        """The true motion at a motion's times, or at the first of them where it is known no further."""
        return exact_motion(motion, self._truth())

    def _truth(self) -> Truth | None:
        return truth_for(self.scene, SECONDS if self.truth is None else self.truth["given"])

    def curves(self) -> dict[Curve, list[Run]]:
        """Runs by engine and family, in the order of the records."""
        curves: dict[Curve, list[Run]] = {}
        for run in self.runs:
            curves.setdefault(run.curve, []).append(run)
        return curves

    def varied_settings(self, run: Run) -> str:
        """The settings of a run that vary along its curve, as printed (``rtol=1e-06``); all if alone."""
        return varied_settings(run.record, [other.record for other in self.runs])

    def completed(self) -> list[Run]:
        return [run for run in self.runs if run.completed]

    def best(self) -> dict[Curve, Run]:
        """Return for each curve the completed run of least error, otherwise the run that got furthest."""
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
    """Runs grouped by scene, in the order of ``scenes``, with the scene's records of the gate, of its truth
    and of the motions shown; scenes without runs are left out."""
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
    """``20 s`` for a run of the paper that completed, else end time and footnote or name of the outcome."""
    return "20 s" if run.completed else f"{run.t_end:.4g} s {run.outcome.letter or run.outcome.label}"


def plain(value: Any) -> str:
    """A setting as text, numbers in their shortest form."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def number(value: float, digits: int = 2) -> str:
    """A measured number for a table cell; an en dash where there is none."""
    return "–" if not math.isfinite(value) else f"{value:.{digits}g}"


def ratio(value: float) -> str:
    """A multiple for a table cell."""
    return "–" if not math.isfinite(value) else f"{value:.1f}"


def short(level: float) -> str:
    """An error level in words of the page: 1e-3."""
    return f"{level:.0e}".replace("e-0", "e-")


def power(value: float) -> str:
    """An error for a table cell: one decimal and a power of ten."""
    return "–" if not math.isfinite(value) else "0" if value == 0 else f"{value:.1e}"


ROUNDING = 1e-11  # smaller differences from the judge's solution are rounding


def beyond_rounding(value: float) -> str:
    """A difference for a table cell that is the same on every machine: rounding is not printed."""
    return f"< {ROUNDING:g}" if 0 < value < ROUNDING else power(value)


def duration(seconds: float) -> str:
    """Seconds with the unit that suits them."""
    if not math.isfinite(seconds):
        return "–"
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds * 1e6:.3g} µs"
