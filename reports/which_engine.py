"""The page "Which engine, which settings, for my mechanism?", from committed records.

``python -m reports.which_engine docs/which-engine.md`` writes it anew, without a path it prints the page.
``python -m reports.which_engine --keep REPORT`` keeps the records of a report as records of further kinds,
beside the stored records of other scenes. `make kinds` does both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from crosscheck.cli.tables import own_code
from crosscheck.findings.finding import findings
from crosscheck.study.grades import Grade, Judged
from crosscheck.study.grid import Record
from crosscheck.study.record_view import ended, error_text, is_completed
from crosscheck.study.store import MOTION, pack
from crosscheck.study.words.speed import LEVEL, SAID, title
from mbref.command_line import Parser
from mbref.files import file_name
from mbref.motions.trajectory import Outcome
from mbref.records import rewrite

from .runs import SceneRuns, duration, plain
from .stored import groups, verified

HERE = Path(__file__).parent
KINDS_FOLDER = HERE / "kinds"
FOLDERS = (HERE / "reference", KINDS_FOLDER)  # of committed records
HEAD = f"""# Which engine, which settings, for my mechanism?

This page answers by kind of mechanism: which engines reach an error of {SAID}, at which settings, in which
time, and what the engines' own defaults do. Use it to choose a first engine and first settings. Every answer
is read from committed records of runs (`reports/reference`, `reports/kinds`), by
`python -m reports.which_engine docs/which-engine.md`.

For numbers of your own mechanism, on your machine, type

```sh
mbref diagnose my.toml             # which kind is it? redundant rows, freedoms, singular positions
crosscheck compare my.toml         # the tables of this page for your mechanism
crosscheck tune mujoco my.toml     # the cheapest settings of one engine
```

Times are CPU time of stepping, of one machine; compare them within a table only. `crosscheck list settings`
explains the families of settings, such as `tuned`; families named `compiled` or `dop853` are integrated by
crosscheck, not by the engine. The page [Engines on closed loops](closed-loops.md) has the
errors of more engines on more kinds (long runs, couplings). [Compare engines](compare.md#verdicts) explains
errors and grades, and the [support table](engines.md#support) has the joints and loads of each engine.
"""


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


def page(folders: Sequence[Path] = FOLDERS) -> str:
    """Return the page in Markdown."""
    known = {g.scene.name: g for folder in folders if folder.is_dir() for g in groups(folder)}
    kinds = [(kind, [known[name] for name in kind.scenes if name in known]) for kind in KINDS]
    kinds = [(kind, found) for kind, found in kinds if found]
    parts = [HEAD, *_in_short(kinds)]
    for kind, found in kinds:
        parts += _section(kind, found)
    parts += [*_many(known["planar_slider_crank"]), *_failures(folders[0])]
    return "\n".join(parts) + "\n"


def judged(group: SceneRuns) -> Judged:
    """Return the runs of a scene with grades; raises ValueError if the scene's truth is not in the folder."""
    if group.truth is None:
        raise ValueError(f"{group.scene.name}: the folder has no record of its truth")
    return Judged(group.scene, group.truth, [run.record for run in group.runs])


def _in_short(kinds: Sequence[tuple[Kind, Sequence[SceneRuns]]]) -> Iterator[str]:
    yield "## In short\n"
    yield f"| mechanism | fastest within {SAID} | next engine | defaults that end wrong or fail |"
    yield "|---|---|---|---|"
    for kind, found in kinds:
        group = judged(found[0])
        first, second = (*_fastest(group), None, None)[:2]
        anchor = kind.title.lower().replace(" ", "-")
        yield f"| [{kind.title}](#{anchor}) | {_named(first)} | {_named(second)} | {_bad_defaults(group)} |"
    yield ""


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


def _section(kind: Kind, found: Sequence[SceneRuns]) -> Iterator[str]:
    yield f"## {kind.title}\n"
    yield f"{kind.about}\n"
    for runs in found:
        yield from _answers(judged(runs))


def _answers(group: Judged) -> Iterator[str]:
    """Yield the table of a scene, its command and the engines' own lines."""
    name, counts = group.scene.name, group.scene.counts()
    yield (
        f"`{name}` over {_end_time(group):g} s: {_count(len(group.scene.body), 'body', 'bodies')}, "
        f"{_count(counts.degrees_of_freedom, 'degree', 'degrees')} of freedom, "
        f"{_count(counts.redundant, 'redundant row', 'redundant rows')}. "
        f"`crosscheck compare '{name}'` repeats these runs.{_known(group)}\n"
    )
    yield f"| engine | fastest run within {SAID} | time | error | least error | library defaults |"
    yield "|---|---|--:|--:|--:|---|"
    cheapest, defaults = group.cheapest(LEVEL), group.defaults()
    order = [r["engine"] for r in _fastest(group)]
    for engine, best in sorted(group.best().items(), key=lambda item: _place(order, item[0])):
        record = cheapest.get(engine)
        cells = ("none", "–", "–") if record is None else _run_cells(record)
        default = _default(defaults[engine]) if engine in defaults else "no such settings"
        yield f"| {title(engine)} | {' | '.join(cells)} | {_least(best)} | {default} |"
    yield from _lines(group)


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
    options = ", ".join(f"{k}={plain(v)}" for k, v in record["asked"]["options"].items())
    return f"`{record['family']}`, {options}", duration(record["cost"]["seconds"]), error_text(record)


def _least(record: Record) -> str:
    return error_text(record) if is_completed(record) else _failed(record)


def _default(record: Record) -> str:
    return _end(record) if is_completed(record) else f"no run completes: {_failed(record)}"


def _lines(group: Judged) -> Iterator[str]:
    """Yield each engine's own code or XML of its settings, to be copied."""
    found = group.within(LEVEL, lambda record: bool(own_code(group.scene, record)))
    if found:
        best = f"the fastest run with an error within {SAID}, otherwise the most accurate run"
        yield f"\nLines to copy, for settings that the engine itself has: {best}.\n"
        yield "```text"
        for engine, record in found.items():
            yield f"{title(engine)}, error {error_text(record)}: {own_code(group.scene, record)}"
        yield "```"
    yield ""


def _many(group: SceneRuns) -> Iterator[str]:
    """Yield the cost of one variant among many: construction of the model and steps."""
    yield "## Many variants at once\n"
    yield (
        "If each of many runs has other numbers, the engine's model is built anew for each, so that "
        "construction counts as well as stepping. One run of "
        f"`{group.scene.name}`, the fastest of each engine within {SAID}:\n"
    )
    yield "| engine | construction | stepping | both |"
    yield "|---|--:|--:|--:|"
    for record in sorted(judged(group).cheapest(LEVEL).values(), key=_whole):
        build, steps = record["cost"]["build_seconds"], record["cost"]["seconds"]
        times = " | ".join(map(duration, (build, steps, build + steps)))
        yield f"| {title(record['engine'])}, `{record['family']}` | {times} |"
    yield "\n`mbref ensemble` runs variants on every core and shares what they have in common"
    yield "([Many runs at once](methods.md#many-runs-at-once)).\n"


def _whole(record: Record) -> float:
    return float(record["cost"]["build_seconds"] + record["cost"]["seconds"])


def _failures(folder: Path) -> Iterator[str]:
    """Yield the failed checks of the conformance suite and the findings, by engine."""
    yield "## What each engine fails at\n"
    yield "Checks of the [conformance suite](verify-your-engine.md), and defects that a script shows:\n"
    yield "| engine | checks that fail | of | findings |"
    yield "|---|--:|--:|---|"
    known: dict[str, list[str]] = {}
    for found in findings():
        known.setdefault(found.engine, []).append(f"[{found.name}](findings.md#{found.name})")
    for name, failed, count in _checks(folder):
        yield f"| {title(name)} | {failed} | {count} | {', '.join(known.pop(name, [])) or 'none'} |"
    for name, links in known.items():
        yield f"| {title(name)} | – | – | {', '.join(links)} |"
    yield "\n`crosscheck verify ENGINE` runs the checks, `crosscheck findings --recheck` the scripts."


def _checks(folder: Path) -> Iterator[tuple[str, int, int]]:
    """Yield engine, failed checks and all checks that applied, of the verdicts on the suite's own scenes."""
    for document in verified(folder):
        states = [verdict["status"] for verdict in document.get("verdicts", ())]
        if applied := [state for state in states if state in ("pass", "fail")]:
            yield document["engine"], applied.count("fail"), len(applied)


def keep(found: Sequence[SceneRuns], folder: Path) -> None:
    """Pack scenes, truths, and the records of runs without their motions into a folder."""
    with TemporaryDirectory() as place:
        (Path(place) / "scenes").mkdir()
        for group in found:
            group.scene.save(Path(place) / "scenes" / f"{file_name(group.scene.name)}.toml")
        rewrite(Path(place) / "records.jsonl", [run.record for group in found for run in group.runs])
        rewrite(Path(place) / "truths.jsonl", [group.truth for group in found if group.truth])
        pack(Path(place), folder, MOTION)


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("page", nargs="?", type=Path, help="default: print the page")
    parser.add_argument("--keep", type=Path, metavar="REPORT", help="keep the records of this report")
    options = parser.parse_args()
    if options.keep:
        new = groups(options.keep)
        names = {group.scene.name for group in new}
        keep([*new, *(old for old in groups(KINDS_FOLDER) if old.scene.name not in names)], KINDS_FOLDER)
    elif options.page:
        options.page.write_text(page())
    else:
        print(page(), end="")
