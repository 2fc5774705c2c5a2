"""Sentences and numbers on records of small motions, for tables and pages."""

from __future__ import annotations

from collections.abc import Iterator

from crosscheck.small_motions.records import Record


def heading(record: Record) -> str:
    """Return the kind of a pose and its stability."""
    kind = f"Steady motion at {record['rate']:g} rad/s" if record["rate"] else "Equilibrium"
    return f"{kind}, {record['stability']}"


def search(record: Record) -> str:
    """Return a sentence on mbref's own search."""
    if record["mbref_distance"] is None:
        return "The search of `mbref equilibrium` does not find this pose."
    apart = size(record["mbref_distance"])
    return f"`mbref equilibrium` finds this pose, {apart} lengths or rad from the judge's."


def method(result: Record) -> str:
    """Return engine, version and method of a result."""
    return f"{result['engine']} {result['version']}, {result['way']}"


def rows(record: Record) -> Iterator[tuple[str, str]]:
    """Yield each method and its error, the judge first."""
    if record["error"] is None:
        yield "judge (reference)", f"± {record['uncertainty']:.0e}"
    else:
        yield "judge", size(record["error"])
    if record["mbref_error"] is not None:
        yield "mbref modes", size(record["mbref_error"])
    for each in record["results"]:
        yield (
            method(each).removesuffix(", "),
            each["reason"] if each["error"] is None else size(each["error"]),
        )


def size(value: float) -> str:
    """Return an error with one digit; less than rounding as a bound."""
    return "< 1e-15" if value < 1e-15 else f"{value:.0e}"


def written(real: float, imaginary: float) -> str:
    """Return a complex number with ten digits, without parts of rounding size."""
    scale = 1e-12 * max(abs(real), abs(imaginary))
    real, imaginary = (0.0 if abs(x) <= scale else x for x in (real, imaginary))
    if imaginary == 0.0:
        return f"{real:.10g}"
    text = f"{imaginary:+.10g} i"
    return f"{real:.10g} {text[0]} {text[1:]}" if real else text
