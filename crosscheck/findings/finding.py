"""A finding: an error of an engine, its proof, and whether the installed version still has it.

The proof is a script that needs the engine alone, or a scene that runs at a setting and is judged by its
truth. An error that ends the engine's process has words alone: nothing here does harm.
"""

from __future__ import annotations

import contextlib
import enum
import io
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engine import Setting
from crosscheck.judge.metrics import error_series
from crosscheck.judge.truth import truth_for
from crosscheck.processes.child import Child, ChildFailed
from crosscheck.processes.pool import run_isolated
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene

FOLDER = Path(__file__).parent
SAMPLES = 11
TIME_LIMIT = 900.0  # s; some engines compile their code first


def printed_by(script: str) -> str:
    """Return the text that a script prints."""
    with contextlib.redirect_stdout(io.StringIO()) as text:
        exec(compile(script, "<script of a finding>", "exec"), {"__name__": "__main__"})
    return text.getvalue()


class Status(enum.Enum):
    """Result of a proof: whether the installed version still has the error."""

    PRESENT = "present"
    GONE = "gone"
    ABSENT = "not installed"
    UNCLEAR = "unclear"


class Answer(NamedTuple):
    """Status with the tested version, and the measured number or the reason."""

    status: Status
    version: str
    measured: float | None
    words: str


@dataclass(frozen=True)
class When:
    """Conditions under which a model can have a finding, and a remedy by which short runs try it.

    Conditions are ``versions`` of the engine (empty: any), ``families`` of settings, a least number of
    independent ``loops`` and of ``redundant`` rows, one of the types of ``joints`` (empty: any), a
    ``polynomial`` coupling, and bodies that are all ``away`` from the origin (m). The remedy is another
    ``family`` (empty: the same one) and ``options``. The model has the finding if the remedy changes
    accelerations at the start by more than ``above``, relative to the largest, and halves their error;
    without a remedy in the engine, if their error exceeds ``above``. Poses over ``seconds`` count if the
    engine gives no accelerations. ``settings`` are options that a setting must have. If ``finest`` is set,
    only the finest setting of a family is tried, for errors that a finer step does not lower.
    If the run ``keeps`` a quantity of KEPT in truth, its drift over ``seconds`` counts instead. ``says`` is
    the predicate of the sentence for the user, and ``advice`` the remedy.
    """

    says: str
    advice: str
    families: Sequence[str]
    above: float
    versions: Sequence[str] = ()
    loops: int = 0
    redundant: int = 0
    finest: bool = False
    joints: Sequence[str] = ()
    polynomial: bool = False
    away: float = 0.0
    family: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 0.0
    settings: Mapping[str, Any] = field(default_factory=dict)
    keeps: str = ""


@dataclass(frozen=True)
class Finding:
    """``does`` is a sentence on what the engine does. ``right`` is a sentence on the right result, and on its
    source.

    The engine has the error if the number that the proof measures, in ``unit``, exceeds ``wrong_above``.
    ``measured`` was the number at ``version`` of ``package``; without it, rounding decides the number.
    ``needs`` are packages that ``script`` needs besides ``package`` and NumPy. If
    ``crashes`` is set, the engine's process ended at that version, and no proof is stored. ``when`` has
    conditions under which users hear of the finding at their own model (`at_model`).
    """

    name: str
    engine: str
    package: str
    version: str
    does: str
    right: str
    cause: str
    unit: str = ""
    measured: float = math.nan
    wrong_above: float = math.inf
    script: str = ""
    needs: Sequence[str] = ()
    crashes: bool = False
    scene: str = ""
    family: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    when: When | None = None

    def recheck(self) -> Answer:
        """Run the proof against the installed version."""
        try:
            version = metadata.version(self.package)
        except metadata.PackageNotFoundError:
            return Answer(Status.ABSENT, "", None, f"pip install {self.package}")
        if self.crashes:
            return Answer(Status.UNCLEAR, version, None, "no proof is stored: it would end the process")
        return self._of_script(version) if self.script else self._of_scene(version)

    def _of_script(self, version: str) -> Answer:
        with contextlib.closing(Child()) as child:
            try:
                printed = child.call(printed_by, (self.script,), TIME_LIMIT).value.split()
                return self._of_number(version, float(printed[-1]))
            except ChildFailed as failure:
                said = str(failure)
            except (IndexError, ValueError):
                said = " ".join(printed) or "nothing"
        return Answer(Status.UNCLEAR, version, None, f"the script gave no number: {said}")

    def _of_scene(self, version: str) -> Answer:
        scene = Scene.from_file(FOLDER / self.scene)
        times = np.linspace(0.0, scene.duration, SAMPLES)
        run = run_isolated(self.engine, scene, times, Setting(self.family, self.options), TIME_LIMIT)
        if run.outcome is not Outcome.COMPLETED:
            return Answer(Status.UNCLEAR, version, None, f"{run.outcome.label} {run.message}".strip())
        truth = truth_for(scene)
        assert truth is not None, scene.name
        return self._of_number(version, float(error_series(scene, run, truth.poses(times)).max()))

    def _of_number(self, version: str, measured: float) -> Answer:
        found = Status.PRESENT if not measured <= self.wrong_above else Status.GONE
        return Answer(found, version, measured, f"{measured:.3g} {self.unit}".strip())

    def command(self) -> str:
        """Return the command that runs the proof again."""
        return f"crosscheck findings --recheck {self.name}"


def findings() -> Sequence[Finding]:
    """Return the stored findings."""
    return [_finding(entry) for entry in tomllib.loads((FOLDER / "findings.toml").read_text())["finding"]]


def _finding(entry: Mapping[str, Any]) -> Finding:
    when = {"when": When(**entry["when"])} if "when" in entry else {}
    return Finding(**{**entry, **when})
