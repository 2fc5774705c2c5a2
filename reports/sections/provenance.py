"""Section: origin of the numbers, with versions, machines, settings, seed, and the commands that repeat the
runs."""

from __future__ import annotations

from collections.abc import Sequence

from crosscheck.setting import option_text

from ..blocks import Block, Heading, Listing, Table, Text
from ..runs import Curve, Run, SceneRuns
from ..sections.records import path


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return versions and machines of all records, the settings of every family, and the commands."""
    runs = [run for group in groups for run in group.runs]
    return [
        Heading("Provenance", 2),
        Text(
            f"{len(runs)} records{_made(runs)}; seed {_all({str(run.record['seed']) for run in runs})}. "
            f"{_timing(runs)}"
        ),
        _versions(runs),
        _machines(runs),
        _settings(runs),
        Text("These commands, in the folder of this page, make the missing records and render it again:"),
        Listing(_commands(groups)),
    ]


def _made(runs: Sequence[Run]) -> str:
    """Return the commit and the date of the code that made the records; empty without records."""
    commits = sorted({commit for run in runs if (commit := run.record.get("commit"))})
    dates = sorted({date[:10] for run in runs if (date := run.record.get("date"))})
    if not dates:
        return ""
    when = dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}"
    return f" of commit {', '.join(commits)}, {when}" if commits else f" of {when}"


def _timing(runs: Sequence[Run]) -> str:
    repeats = sorted({run.record.get("timing", {}).get("repeats", 1) for run in runs if run.completed})
    if not repeats:
        return "No run completed."
    return (
        f"Time is the CPU time of the stepping alone, the least of {' or '.join(map(str, repeats))} runs; "
        f"where there are several, the runs of a scene took turns in one process."
    )


def _versions(runs: Sequence[Run]) -> Table:
    engines = sorted({(run.record["engine"], run.record["version"] or "not installed") for run in runs})
    packages = sorted({(k, v or "not installed") for run in runs for k, v in run.record["versions"].items()})
    rows = [("engine", *row) for row in engines] + [("package", *row) for row in packages]
    return Table("Versions that made the records.", ("Kind", "Name", "Version"), rows)


def _machines(runs: Sequence[Run]) -> Table:
    machines = {tuple(map(str, run.record["machine"].values())) for run in runs}
    header = tuple(runs[0].record["machine"]) if runs else ()
    return Table("Machines the runs were made on.", header, sorted(machines))


def _settings(runs: Sequence[Run]) -> Table:
    values: dict[tuple[Curve, str], dict[str, None]] = {}
    for run in runs:
        for name, value in run.record["settings"].items():
            values.setdefault((run.curve, name), {})[option_text(value)] = None
    rows = [(*curve, name, ", ".join(seen)) for (curve, name), seen in values.items()]
    return Table("Settings of every family.", ("Engine", "Family", "Option", "Values"), rows, folded=True)


def _commands(groups: Sequence[SceneRuns]) -> str:
    scenes = " ".join(map(path, groups))
    return f"pip install 'mbref[engines,report]'\ncrosscheck report {scenes} --out ."


def _all(values: set[str]) -> str:
    return ", ".join(sorted(values))
