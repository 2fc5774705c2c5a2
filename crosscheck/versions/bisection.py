"""The first released version whose results differ from the results of an earlier one, by bisection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from crosscheck.versions.differences import Found
from crosscheck.versions.environment import NotInstalled
from crosscheck.versions.measured import Measured


class Bisection(NamedTuple):
    """Neighbouring versions between which results change, and the changes; None if the ends agree.

    ``skipped`` has a sentence for each version that could not be measured, ``made`` the number of measured
    ones.
    """

    old: str | None
    new: str | None
    changes: Sequence[Found]
    skipped: Sequence[str]
    made: int


def bisected(
    versions: Sequence[str],
    measure: Callable[[str], Measured],
    between: Callable[[Measured, Measured], Sequence[Found]],
) -> Bisection:
    """Return the bisection of versions, the oldest first. Raises NotInstalled if an end cannot be measured.

    A version counts as new if its results differ from the results of the first version. Versions between the
    ends that cannot be installed are left out.
    """
    left, skipped = list(versions), list[str]()
    done = {version: measure(version) for version in (left[0], left[-1])}
    start = done[left[0]]
    if not any(found.is_result for found in between(start, done[left[-1]])):
        return Bisection(None, None, [], skipped, len(done))
    low, high = 0, len(left) - 1
    while high - low > 1:
        middle = (low + high) // 2
        try:
            done[left[middle]] = measure(left[middle])
        except NotInstalled as reason:
            skipped.append(str(reason))
            del left[middle]
            high -= 1
            continue
        is_new = any(found.is_result for found in between(start, done[left[middle]]))
        low, high = (low, middle) if is_new else (middle, high)
    old, new = left[low], left[high]
    return Bisection(old, new, between(done[old], done[new]), skipped, len(done))
