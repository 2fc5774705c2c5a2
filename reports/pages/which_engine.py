"""The page "Which engine, which settings, for my mechanism?", from committed records."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import mbref
from crosscheck.cli.tables import own_code
from crosscheck.convergence import every_scene
from crosscheck.findings.finding import findings
from crosscheck.setting import option_text
from crosscheck.study.grades import Grade, Judged
from crosscheck.study.grid import Record
from crosscheck.study.record_view import ended, error_text, is_completed
from crosscheck.study.store import read_runs
from crosscheck.study.words.speed import LEVEL, SAID, title
from mbref.motions.trajectory import Outcome

from ..blocks import Block, Fold, Heading, Listing, Marked, Parts, Prose, Table, Within
from ..runs import SceneRuns, duration
from ..stored import groups, verified

REPORTS = Path(__file__).parents[1]
FOLDERS = ("reference", "kinds")  # of committed records


class Kind(NamedTuple):
    """A kind of mechanism: its heading, a sentence by which a reader recognises the kind, and its scenes."""

    title: str
    about: str
    scenes: Sequence[str]


KINDS = (
    Kind(
        "A plane loop",
        "All axes of hinges are parallel. `mbref diagnose` reports up to three redundant rows a loop.",
        ("planar_slider_crank",),
    ),
    Kind(
        "A spatial loop without redundant rows",
        "Axes have several directions, and `mbref diagnose` reports no redundant row.",
        ("spatial_slider_crank",),
    ),
    Kind(
        "A spatial loop with redundant rows",
        "Axes have several directions, and `mbref diagnose` reports redundant rows.",
        ("bennett",),
    ),
    Kind(
        "A chain of loops",
        "Loops follow one another, as in an engine with cylinders in line; each adds bodies and rows.",
        ("slider_crank_chain[4]",),
    ),
    Kind(
        "Drivers prescribe the whole motion",
        "No degree of freedom is left; forces and reactions are asked for (inverse dynamics).",
        ("spatial_slider_crank_driven",),
    ),
    Kind(
        "Driven through singular positions",
        "Drivers prescribe the whole motion, and the rank of the Jacobian drops on the way.",
        ("four_bar", "five_bar"),
    ),
    Kind(
        "Moving freely through singular positions",
        "Gravity or forces move the mechanism through positions at which the motion could branch.",
        ("planar_slider_crank_equal",),
    ),
    Kind(
        "Stiff springs and dampers",
        "A spring or damper acts much faster than the motion: explicit integrators need short steps.",
        ("flyball_governor",),
    ),
)


def parts(records: Path = REPORTS) -> Parts:
    """Return the parts of the page from the folders of committed reports."""
    folders = [folder for name in FOLDERS if (folder := records / name).is_dir()]
    known = {g.scene.name: g for folder in folders for g in groups(folder)}
    kinds = [(kind, [known[name] for name in kind.scenes if name in known]) for kind in KINDS]
    kinds = [(kind, found) for kind, found in kinds if found]
    return {
        "in_short": [_in_short(kinds)],
        "kinds": [block for kind, found in kinds for block in _section(kind, found)],
        "many": [_many(known["planar_slider_crank"])],
        "newer_limit": f"{every_scene.TIME_LIMIT:g}",
        "newer": [Table("Families on every built-in scene.", every_scene.SUMMARY, _newer())],
        "failures": [_failures(folders[0])],
        "level": SAID,
    }


def _newer() -> list[tuple[str, ...]]:
    return every_scene.summary(read_runs(every_scene.FILE))


def judged(group: SceneRuns) -> Judged:
    """Return the runs of a scene with grades; raises ValueError if the scene's truth is not in the folder."""
    if group.truth is None:
        raise ValueError(f"{group.scene.name}: the folder has no record of its truth")
    return Judged(group.scene, group.truth, [run.record for run in group.runs])


def _in_short(kinds: Sequence[tuple[Kind, Sequence[SceneRuns]]]) -> Table:
    rows = []
    for kind, found in kinds:
        group = judged(found[0])
        first, second = (*_fastest(group), None, None)[:2]
        name = Within(kind.title, f"#{kind.title.lower().replace(' ', '-')}")
        rows.append((name, _named(first), _named(second), _bad_defaults(group)))
    header = ("mechanism", f"fastest within {SAID}", "next engine", "defaults that end wrong or fail")
    return Table("The first scene of each kind.", header, rows)


def _fastest(group: Judged) -> list[Record]:
    """Return each engine's fastest run within LEVEL, the fastest engine first."""
    return sorted(group.cheapest(LEVEL).values(), key=lambda record: record["cost"]["seconds"])


def _named(record: Record | None) -> str:
    if record is None:
        return "none"
    return f"{title(record['engine'])}, `{record['family']}`, {duration(record['cost']['seconds'])}"


def _bad_defaults(group: Judged) -> str:
    """Return the engines whose library defaults are wrong or complete no run, and the failure of each."""
    said = [
        f"{title(name)}: {_end(record)}"
        for name, record in group.defaults().items()
        if group.grade(record) in (Grade.WRONG, Grade.FAILED)
    ]
    return "; ".join(said) or "none"


def _end(record: Record) -> str:
    return f"error {error_text(record)}" if is_completed(record) else _failed(record)


def _failed(record: Record) -> str:
    limit = f" (limit {record['time_limit']:g} s)" if record["outcome"] == Outcome.TIMED_OUT.label else ""
    return ended(record) + limit


def _section(kind: Kind, found: Sequence[SceneRuns]) -> list[Block]:
    answers = (block for runs in found for block in _answers(judged(runs)))
    return [Heading(kind.title, 2), Prose(kind.about), *answers]


def _answers(group: Judged) -> list[Block]:
    """Return the table of a scene, its command and the engines' own lines."""
    name, counts = group.scene.name, mbref.counts(group.scene)
    caption = (
        f"`{name}` over {_end_time(group):g} s: {_count(len(group.scene.body), 'body', 'bodies')}, "
        f"{_count(counts.degrees_of_freedom, 'degree', 'degrees')} of freedom, "
        f"{_count(counts.redundant, 'redundant row', 'redundant rows')}. "
        f"`crosscheck compare '{name}'` repeats these runs.{_known(group)}"
    )
    header = ("engine", f"fastest run within {SAID}", "time", "error", "least error", "library defaults")
    cheapest, defaults = group.cheapest(LEVEL), group.defaults()
    order, rows = [r["engine"] for r in _fastest(group)], []
    for engine, best in sorted(group.best().items(), key=lambda item: _place(order, item[0])):
        record = cheapest.get(engine)
        cells = ("none", "–", "–") if record is None else _run_cells(record)
        default = _default(defaults[engine]) if engine in defaults else "no such settings"
        rows.append((title(engine), *cells, _least(best), default))
    return [Table(caption, header, rows, frozenset({2, 3, 4})), *_lines(group)]


def _known(group: Judged) -> str:
    until = float(group.truth["until"])
    return (
        f" Errors are of the part up to {until:.3g} s, where the truth ends."
        if until < _end_time(group)
        else ""
    )


def _end_time(group: Judged) -> float:
    return max(float(record["t_end"]) for record in group.records)


def _place(order: Sequence[str], engine: str) -> int:
    return order.index(engine) if engine in order else len(order)


def _count(number: int, one: str, more: str) -> str:
    return f"{number or 'no'} {one if number == 1 else more}"


def _run_cells(record: Record) -> tuple[str, str, str]:
    options = ", ".join(f"{k}={option_text(v)}" for k, v in record["asked"]["options"].items())
    return f"`{record['family']}`, {options}", duration(record["cost"]["seconds"]), error_text(record)


def _least(record: Record) -> str:
    return error_text(record) if is_completed(record) else _failed(record)


def _default(record: Record) -> str:
    return _end(record) if is_completed(record) else f"no run completes: {_failed(record)}"


def _lines(group: Judged) -> list[Block]:
    """Return each engine's own code or XML of its settings, to be copied."""
    found = group.within(LEVEL, lambda record: bool(own_code(group.scene, record)))
    if not found:
        return []
    lines = (
        f"{title(engine)}, error {error_text(record)}: {own_code(group.scene, record)}"
        for engine, record in found.items()
    )
    best = f"the fastest run with an error within {SAID}, otherwise the most accurate run"
    summary = f"Lines to copy, for settings that the engine itself has: {best}."
    return [Fold(summary, f"{group.scene.name}-lines", [Listing("\n".join(lines), "text")])]


def _many(group: SceneRuns) -> Table:
    """Return the cost of one variant among many: construction of the model and steps."""
    caption = (
        "If each of many runs has other numbers, the engine's model is built anew for each, so that "
        "construction counts as well as stepping. One run of "
        f"`{group.scene.name}`, the fastest of each engine within {SAID}:"
    )
    rows = []
    for record in sorted(judged(group).cheapest(LEVEL).values(), key=_whole):
        build, steps = record["cost"]["build_seconds"], record["cost"]["seconds"]
        name = f"{title(record['engine'])}, `{record['family']}`"
        rows.append((name, *map(duration, (build, steps, build + steps))))
    return Table(caption, ("engine", "construction", "stepping", "both"), rows, frozenset({1, 2, 3}))


def _whole(record: Record) -> float:
    return float(record["cost"]["build_seconds"] + record["cost"]["seconds"])


def _failures(folder: Path) -> Table:
    """Return the failed checks of the conformance suite and the findings, by engine."""
    known: dict[str, list[str]] = {}
    for found in findings():
        known.setdefault(found.engine, []).append(f"[{found.name}](findings.md#{found.name})")
    failed = {name: (str(failed), str(count)) for name, failed, count in _checks(folder)}
    rows = [
        (title(name), *failed.get(name, ("–", "–")), Marked(", ".join(known.get(name, [])) or "none"))
        for name in dict.fromkeys([*failed, *known])
    ]
    header = ("engine", "checks that fail", "of", "findings")
    return Table("Failed checks and findings by engine.", header, rows, frozenset({1, 2}))


def _checks(folder: Path) -> Iterator[tuple[str, int, int]]:
    """Yield engine, failed checks and all checks that applied, of the verdicts on the suite's own scenes."""
    for document in verified(folder):
        states = [verdict["status"] for verdict in document.get("verdicts", ())]
        if applied := [state for state in states if state in ("pass", "fail")]:
            yield document["engine"], applied.count("fail"), len(applied)
