"""Section: a table of all runs with outcome, end time and error."""

from __future__ import annotations

import math
from collections.abc import Sequence

from crosscheck.study.record_view import error_bound

from ..blocks import Block, Heading, Linked, Table, Text
from ..places import of_run
from ..runs import Run, SceneRuns, duration, power

HEADER = (
    "Engine",
    "Family",
    "Settings",
    "Outcome",
    "End time (s)",
    "Error",
    "Time",
    "Steps",
    "Right-hand sides",
    "Message",
)


ESTIMATE = "Estimate"  # column of the errors that an engine itself estimates


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return the table of all runs of a scene, and a sentence on the errors that engines estimate."""
    runs = scene_runs.runs
    caption = f"All {len(runs)} runs: outcome, end time, and error up to the end."
    rows = [_row(run, scene_runs.varied_settings(run)) for run in runs]
    header: tuple[str, ...] = HEADER
    if any(math.isfinite(run.estimate) for run in runs):
        place = HEADER.index("Error") + 1
        header = (*HEADER[:place], ESTIMATE, *HEADER[place:])
        rows = [
            (*row[:place], power(run.estimate), *row[place:]) for run, row in zip(runs, rows, strict=True)
        ]
    right = frozenset(range(4, len(header) - 1))
    table = Table(caption, header, rows, right=right, folded=True)
    return [Heading("Outcomes"), *_on_estimates(runs), table]


def _on_estimates(runs: Sequence[Run]) -> list[Block]:
    """Return a sentence that compares estimated errors with the errors against the truth; none without
    estimates."""
    judged = [run for run in runs if math.isfinite(run.estimate) and math.isfinite(run.error)]
    known = [run for run in judged if max(run.error, run.estimate) > error_bound(run.record)]
    if not judged:
        return []
    engines = " and ".join(dict.fromkeys(run.curve[0] for run in judged))
    text = (
        f"{engines} estimates the error of each run by a second run, without the truth "
        "(docs/error-estimate.md). "
    )
    if not known:
        return [Text(text + f"All {len(judged)} estimates and errors are below the bound of the truth.")]
    low, high = (
        pick(run.error / run.estimate if run.estimate else math.inf for run in known) for pick in (min, max)
    )
    return [
        Text(
            text
            + f"Error over estimate lies between {low:.2g} and {high:.2g} in the {len(known)} runs whose "
            "error or estimate exceeds the bound of the truth."
        )
    ]


def _row(run: Run, settings: str) -> tuple[str, ...]:
    cost = run.record["cost"]
    letter = f" ({run.outcome.letter})" if run.outcome.letter else ""
    settled = Linked(settings or "all", f"#{of_run(run)}")
    return (
        *run.curve,
        settled,
        run.outcome.label + letter,
        f"{run.t_end:.4g}",
        run.said,
        duration(run.seconds),
        str(cost["steps"]),
        str(cost["rhs"]),
        run.record["message"],
    )
