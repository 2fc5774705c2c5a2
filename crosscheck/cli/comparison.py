"""The function `crosscheck.compare`, whose result has a verdict, rows and records."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from crosscheck.alternatives.at_model import Disagreement, disagreements
from crosscheck.cli import request, scene_request, tables
from crosscheck.cli.planning import Choice, plan
from crosscheck.engine import engine
from crosscheck.findings.at_model import Defect, defects
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.start import started
from crosscheck.study.comparison import Collection, Notice, Wanted, collected
from crosscheck.study.dead_positions import followed
from crosscheck.study.fair_timing import force_differences, model_differences
from crosscheck.study.grades import Grade, Judged, judged
from crosscheck.study.grid import TIME_LIMIT, Record
from crosscheck.study.record_view import error, is_completed, public
from crosscheck.study.search import selection
from crosscheck.study.search.offers import settings
from crosscheck.study.words.verdict import Verdict, verdict
from mbref.files import write
from mbref.scene import Scene
from mbref.terminal import Console

if TYPE_CHECKING:
    import pandas

TRUTH = ("kind", "bound", "until", "seconds", "reason", "both")  # shown fields of a truth's record
WIDTH = 80
Row = dict[str, Any]


@dataclass(frozen=True)
class Comparison:
    """Comparison of several engines on one mechanism. ``print`` shows the output of `crosscheck compare`.

    Attributes
    ----------
    judged : Judged
        The scene, the record of its truth, the records of all runs, and for each engine that simulates
        another mechanism how it differs.
    path : str
        Name of the scene in commands.
    difference : str or None
        One sentence on the first engine whose mechanism differs. None if all agree.
    defects : sequence of Defect
        Known defects of engines that show at this mechanism (`crosscheck.findings.at_model`).
    disagreements : sequence of Disagreement
        Ways of an engine to solve the same equations that differ here (`crosscheck.alternatives.at_model`).
    """

    judged: Judged
    path: str
    difference: str | None
    defects: Sequence[Defect] = ()
    disagreements: Sequence[Disagreement] = ()

    @cached_property
    def verdict(self) -> Verdict:
        """Sentences of the verdict: headline, right, fast, breaks and truth."""
        return verdict([self.judged], self._unlike)

    @property
    def _unlike(self) -> str | None:
        """Return the difference between the engines' mechanisms if no truth shows which engine is wrong."""
        return None if self.judged.differences else self.difference

    @property
    def records(self) -> Sequence[Record]:
        """Records of all runs."""
        return self.judged.records

    @property
    def rows(self) -> list[Row]:
        """One dictionary for each run: completed runs first, in the order of increasing error.

        Keys: engine, family, settings, verdict, outcome, end time (s), error and the other metrics, CPU
        seconds of stepping, and steps.
        """
        ordered = sorted(self.records, key=lambda r: (not is_completed(r), error(r)))
        return [_row(r, self.judged.grade(r)) for r in ordered]

    def to_dataframe(self) -> pandas.DataFrame:
        """Return ``rows`` as a pandas DataFrame.

        Returns
        -------
        pandas.DataFrame
            One row for each run.
        """
        import pandas

        return pandas.DataFrame(self.rows)

    def document(self) -> dict[str, Any]:
        """Return the document of `crosscheck compare --json`.

        Returns
        -------
        dict
            Scene, records, verdict, truth, differences between the engines' mechanisms, known defects, and
            ways of an engine that differ.
        """
        known = self.judged.truth
        truth = {**{name: known[name] for name in TRUTH}, "dead": known.get("dead")}
        return {
            "scene": self.judged.scene.name,
            "records": [public(r) for r in self.records],
            "verdict": self.verdict._asdict(),
            "truth": truth,
            "difference": self.difference,
            "differences": dict(self.judged.differences),
            "defects": [one._asdict() for one in self.defects],
            "disagreements": [one._asdict() for one in self.disagreements],
        }

    def save(self, path: str | Path) -> None:
        """Write ``document`` as JSON.

        Parameters
        ----------
        path : str or path
            The file, which ends in ``.json``.

        Raises
        ------
        ValueError
            If the file's name does not end in ``.json``.
        """
        if Path(path).suffix.lower() != ".json":
            raise ValueError(f"{path}: a comparison is saved as .json")
        write(path, json.dumps(self.document(), allow_nan=False) + "\n")

    def print(self, console: Console) -> None:
        """Print the verdict, tables, a plot, known defects, and ways of an engine that differ.

        Parameters
        ----------
        console : rich.console.Console
            The console on which they are printed.
        """
        tables.print_comparison(console, self.judged, self.verdict, self.path, with_ratio=not self._unlike)
        for one in self.defects:
            sentence = f"\nKnown defect: {one.sentence}; `crosscheck findings {one.finding}`"
            console.print(sentence, markup=False, soft_wrap=True)
        for pair in self.disagreements:
            console.print(f"\nSolvers differ: {pair.sentence}", markup=False, soft_wrap=True)

    def __str__(self) -> str:
        text = io.StringIO()
        self.print(Console(file=text, width=WIDTH))
        return text.getvalue()

    def __repr__(self) -> str:
        return f"<Comparison of {', '.join(self.judged.engines())}: {self.verdict.headline}>"


def compare(
    scene: Scene | str | Path,
    engines: str | Sequence[str] | None = None,
    *,
    families: str | Sequence[str] | None = None,
    depth: str = "quick",
    duration: float | None = None,
    samples: int = selection.QUICK_SAMPLES,
    time_limit: float | None = None,
    reference_time: float = SECONDS,
    out: str | Path | None = None,
    notice: Notice | None = None,
) -> Comparison:
    """Compare engines on a mechanism, as `crosscheck compare` does.

    Parameters
    ----------
    scene : Scene, str or path
        A Scene, the name of a built-in one, or a .toml file.
    engines : str or sequence of str, optional
        Names of engines. Default: mbref, MuJoCo, Pinocchio, Exudyn and installed optional engines.
    families : str or sequence of str, optional
        Families of settings. Default: a few; all if ``depth`` is ``"whole"``.
    depth : {"quick", "whole"}
        How many families and settings run.
    duration : float, optional
        End time, s. Default: the scene's duration.
    samples : int
        Number of sample times.
    time_limit : float, optional
        CPU time (s) of one run.
    reference_time : float
        CPU time (s) of the reference solution.
    out : path, optional
        Folder in which records are kept. They are not made again.
    notice : callable, optional
        Receives sentences about engines that are left out.

    Returns
    -------
    Comparison
        Verdict, rows and records.

    Raises
    ------
    RequestError
        If the request cannot be met.
    SceneError
        If the scene is faulty.
    """
    if depth not in ("quick", "whole"):
        raise request.RequestError(f"depth: must be quick or whole, got {depth!r}")
    tell, is_quick = notice or _silent, depth == "quick"
    given = started(scene) if isinstance(scene, Scene) else scene_request.find_scenes([str(scene)])[0]
    lasting = request.lasting(given, None, duration)
    names = request.find_engines(_several(engines), tell)
    lasting, when, dead = followed(lasting, request.sample_times(lasting, None, samples), reference_time)
    times = [when]
    limit = time_limit or (selection.QUICK_LIMIT if is_quick else TIME_LIMIT)
    chosen = Choice(_several(families), is_quick=is_quick)
    found = collected(
        [lasting],
        names,
        Wanted(
            times,
            reference_time,
            is_quick,
            None if out is None else Path(out),
            is_named=chosen.is_named,
            dead=[dead],
        ),
        lambda: plan([lasting], names, chosen, times, limit, tell),
        tell,
    )
    path = f"{given.name}.toml" if isinstance(scene, Scene) else str(scene)
    return comparisons(found, {lasting.name: path}, names, reference_time)[0]


def _several(names: str | Sequence[str] | None) -> Sequence[str] | None:
    """Return the names, one of which may be given alone."""
    return [names] if isinstance(names, str) else names


def comparisons(
    found: Collection, paths: dict[str, str], names: Sequence[str], reference_time: float
) -> list[Comparison]:
    """Return one Comparison for each scene of a collection of records.

    ``paths`` are the names of the scenes in commands, and ``names`` the engines.
    """
    compared = []
    for group in judged(found.scenes, found.truths, found.records):
        scene, gates = group.scene, [r for r in found.identities if r["scene"] == group.scene.name]
        differences = model_differences(scene, gates, reference_time, group.records)
        if group.truth["kind"]:
            differences |= force_differences(scene, group.records)
        first = next(iter(differences.values()), None)
        blamed = differences if group.truth["kind"] else {}
        engines = [name for name in names if engine(name).name in group.engines()]
        shown = replace(group, differences=blamed)
        known = defects(scene, engines, partial(settings, scene=scene))
        ways = disagreements(scene, engines)
        compared.append(Comparison(shown, paths[scene.name], first, known, ways))
    return compared


def _row(record: Record, found: Grade) -> Row:
    return {
        "engine": record["engine"],
        "family": record["family"],
        "settings": record["asked"]["options"],
        "verdict": str(found),
        "outcome": record["outcome"],
        "t_end": record["t_end"],
        **record["metrics"],
        "seconds": record["cost"]["seconds"],
        "steps": record["cost"]["steps"],
    }


def _silent(sentence: str) -> None:
    """Ignore a sentence for the user."""
