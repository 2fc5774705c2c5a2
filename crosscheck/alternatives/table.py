"""Table of alternatives from stored records: how far pairs of ways differ, and the known causes."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from statistics import median
from typing import NamedTuple

from crosscheck.study.record_shape import Record

CAUSES = Path(__file__).parent / "causes.toml"
UNKNOWN = "not found"
HEADER = ("engine", "version", "ways", "mechanisms", "bodies", "refused", "pairs", "worst", "above the limit")


class Cause(NamedTuple):
    """Why a way of an engine differs from the others, and the finding that shows it, if there is one."""

    engine: str
    way: str
    because: str
    finding: str = ""


class Difference(NamedTuple):
    """Largest relative difference of two ways on a mechanism, in a quantity of a body."""

    size: float
    quantity: str
    body: str
    scene: str
    bodies: int


class Pair(NamedTuple):
    """Differences of two ways of an engine, in descending order, and their limit ``within``."""

    engine: str
    ways: tuple[str, str]
    within: float
    found: Sequence[Difference]

    @property
    def median(self) -> float:
        """Return the median of the differences."""
        return median(each.size for each in self.found)

    @property
    def above(self) -> list[Difference]:
        """Return the differences above the limit."""
        return [each for each in self.found if each.size > self.within]

    @property
    def cause(self) -> Cause | None:
        """Return the cause of differences above the limit; None if there are none.

        The cause is UNKNOWN if none is listed.
        """
        if not self.above:
            return None
        listed = (each for each in causes() if each.engine == self.engine and each.way in self.ways)
        return next(listed, Cause(self.engine, " – ".join(self.ways), UNKNOWN))


class Completed(NamedTuple):
    """Completed runs of a way: CPU times (s), and distances from Gauss's principle at the start, if the
    engine gives accelerations."""

    seconds: list[float]
    off: list[float]


class Above(NamedTuple):
    """A cause, and the pairs of ways that differ by it above their limit."""

    cause: Cause
    pairs: Sequence[Pair]


@cache
def causes() -> tuple[Cause, ...]:
    """Return the known causes."""
    return tuple(Cause(**each) for each in tomllib.loads(CAUSES.read_text(encoding="utf-8"))["cause"])


def engines(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Return the records of each engine."""
    return {
        name: [r for r in records if r["engine"] == name]
        for name in dict.fromkeys(r["engine"] for r in records)
    }


def compared(records: Sequence[Record]) -> list[Record]:
    """Return the records in which at least two ways of a group complete."""
    return [record for record in records if any(group["pairs"] for group in record["groups"])]


def pairs(records: Sequence[Record]) -> list[Pair]:
    """Return the pairs of an engine's ways that complete on a mechanism, in their order."""
    found: dict[tuple[float, str, str], list[Difference]] = {}
    for record in records:
        for group in record["groups"]:
            for first, second, size, quantity, body in group["pairs"]:
                known = found.setdefault((group["within"], first, second), [])
                known.append(Difference(size, quantity, body, record["scene"], record["bodies"]))
    engine = records[0]["engine"]
    return [
        Pair(engine, (first, second), within, sorted(differences, reverse=True))
        for (within, first, second), differences in found.items()
    ]


def above(found: Mapping[str, Sequence[Record]]) -> list[Above]:
    """Return the causes of differences above a limit, from the records of each engine."""
    by_cause: dict[Cause, list[Pair]] = {}
    for own in found.values():
        for pair in pairs(own):
            if pair.cause:
                by_cause.setdefault(pair.cause, []).append(pair)
    return [Above(cause, of_cause) for cause, of_cause in by_cause.items()]


def ways(records: Sequence[Record]) -> dict[str, Completed]:
    """Return the completed runs of each way."""
    found: dict[str, Completed] = {}
    for group in (group for record in records for group in record["groups"]):
        for way, end in group["ended"].items():
            if not end:
                of_way = found.setdefault(way, Completed([], []))
                of_way.seconds.append(group["seconds"][way])
                if way in group["off"]:
                    of_way.off.append(group["off"][way])
    return found


def ends(records: Sequence[Record]) -> Iterator[tuple[str, str, int]]:
    """Yield ways, how they ended early, and on how many mechanisms."""
    counted = Counter(
        (way, end.split(":", 1)[0])
        for record in records
        for group in record["groups"]
        for way, end in group["ended"].items()
        if end
    )
    for (way, outcome), count in counted.items():
        yield way, outcome, count


def line(records: Sequence[Record]) -> tuple[str, ...]:
    """Return the row of an engine, under HEADER."""
    done, found = compared(records), pairs(records)
    ways = {way for record in records for group in record["groups"] for way in group["ended"]}
    sizes = [record["bodies"] for record in done]
    worst = max(found, key=lambda pair: pair.found[0].size / pair.within, default=None)
    return (
        records[0]["engine"],
        records[0]["version"],
        str(len(ways)),
        str(len(done)),
        f"{min(sizes)} to {max(sizes)}" if sizes else "",
        str(sum(bool(record["refused"]) for record in records)),
        str(len(found)),
        f"{worst.found[0].size:.0e}: {' – '.join(worst.ways)}" if worst else "",
        f"{sum(bool(pair.above) for pair in found)} pairs",
    )
