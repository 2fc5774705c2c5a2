"""Section: a table of all runs with outcome, end time and error."""

from __future__ import annotations

from reports.blocks import Block, Heading, Linked, Table
from reports.places import of_run
from reports.runs import Run, SceneRuns, duration

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


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return the table of all runs of a scene."""
    runs = scene_runs.runs
    caption = f"All {len(runs)} runs: outcome, end time, and error up to the end."
    rows = [_row(run, scene_runs.varied_settings(run)) for run in runs]
    return [Heading("Outcomes"), Table(caption, HEADER, rows, right=frozenset(range(4, 9)), folded=True)]


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
