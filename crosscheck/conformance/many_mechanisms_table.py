"""Terminal tables of the checks on random mechanisms."""

from __future__ import annotations

from collections.abc import Iterator

from rich.box import SIMPLE
from rich.table import Column, Table
from rich.text import Text

from crosscheck.conformance.many_mechanisms import Tally, about
from crosscheck.conformance.suite import CANNOT, FAIL, OUTSIDE, PASS, RUN, check_of

COLUMNS = (PASS, FAIL, CANNOT, OUTSIDE)


def tables(tally: Tally) -> Iterator[Table | Text]:
    """Return a table of checks with their counts and the largest ratio of value to limit, then the
    violations."""
    plan = tally.plan
    first, last = plan.first, plan.first + tally.seeds - 1
    title = f"{plan.engine} {tally.version} {plan.family}: random mechanisms, seeds {first} to {last}"
    numbers = (Column(name, justify="right") for name in COLUMNS)
    table = Table("check", *numbers, "largest value / allowance", "it checks", title=title, box=SIMPLE)
    for name, counts in tally.counts.items():
        used, scene = tally.worst.get(name, (0.0, ""))
        row = (str(counts[status]) for status in COLUMNS)
        table.add_row(check_of(name), *row, f"{used:.0e} {scene}" if used else "", about(name))
    yield table
    for v in tally.violations:
        numbers_of = "" if v["measured"] is None else f" {v['measured']:.3g}, allowed {v['allowed']:.3g}"
        yield Text(f"fail: {v['scene']}, {v['card']}:{numbers_of} {v['reason']}".rstrip())
    yield Text(_summary(tally))


def _summary(tally: Tally) -> str:
    """Return a sentence with the number of violations and the number of mechanisms that ran."""
    ran, drawn = tally.decided(RUN), f"{tally.seeds} random mechanisms"
    if not ran:
        return f"{tally.plan.engine}: ran none of {drawn}, so it is not judged"
    return f"{tally.plan.engine}: {len(tally.violations)} violated checks; the engine ran {ran} of {drawn}"
