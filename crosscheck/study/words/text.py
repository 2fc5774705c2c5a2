"""Text of numbers and lists in the sentences of a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence


def listed(names: Iterable[str]) -> str:
    """Return the names as ``a, b and c``."""
    *most, last = [*names] or [""]
    return f"{', '.join(most)} and {last}" if most else last


def at_most(value: float, bound: float) -> str:
    """Return an error rounded up to two digits, or the truth's own bound if that is larger."""
    if value < bound:
        return f"less than the truth's own bound, {bound:.0e}"
    if not value:
        return "0"
    exponent = math.floor(math.log10(value))
    tenths = math.ceil(value / 10.0 ** (exponent - 1))
    return f"{tenths / 10:.1f}e{exponent}" if tenths < 100 else f"1.0e{exponent + 1}"


def runs(number: int) -> str:
    """Return ``1 run``, ``2 runs`` and so on."""
    return f"{number} run{'s' if number != 1 else ''}"


def uncapitalised(sentence: str) -> str:
    """Return a sentence with a small first letter, for use within another one; names keep their capitals."""
    return sentence[0].lower() + sentence[1:] if sentence.startswith(("All ", "Both ", "No ")) else sentence


def is_or_are(names: Sequence[object]) -> str:
    """Return ``is`` for one name, ``are`` for several."""
    return "is" if len(names) == 1 else "are"


def its_or_their(names: Sequence[str]) -> str:
    """Return ``its`` for one name, ``their`` for several."""
    return "its" if len(names) == 1 else "their"


def agree(names: Sequence[str]) -> str:
    """Return ``agrees`` for one name, ``agree`` for several."""
    return "agrees" if len(names) == 1 else "agree"


def seconds(value: float) -> str:
    """Return a time in s, ms or µs."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3)):
        if float(f"{value:.3g}") >= scale:
            return f"{value / scale:.3g} {unit}"
    return f"{value * 1e6:.3g} µs"


def multiple(ratio: float) -> str:
    """Return a ratio as ``3.2 times`` or ``140 times``."""
    return f"{ratio:.1f} times" if ratio < 9.95 else f"{ratio:.0f} times"


def span(least: float, most: float) -> str:
    """Return two ratios as ``3.2 to 140 times``, or as one multiple if they are equal."""
    low, high = multiple(least), multiple(most)
    return low if low == high else f"{low.removesuffix(' times')} to {high}"
