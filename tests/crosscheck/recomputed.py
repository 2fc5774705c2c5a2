"""The statements of a verdict, recomputed from records by other code than the verdict's."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

RIGHT, WRONG, LEVEL = 1e-8, 1e-2, 1e-6  # limits of grades, and the error at which speeds are compared
WRITTEN = {
    "MuJoCo": "mujoco",
    "Pinocchio": "pinocchio",
    "Exudyn": "exudyn",
    "Simbody": "simbody",
    "SUNDIALS IDA": "sundials",
    "OndselSolver": "ondsel",
    "CasADi": "casadi",
}
Record = Mapping[str, Any]


def engines(listed: str) -> list[str]:
    """The engines of ``MuJoCo, mbref and Exudyn``."""
    return [WRITTEN.get(name, name) for name in re.split(r", | and | nor ", listed.strip())]


def completed(records: Sequence[Record], engine: str, family: str | None = None) -> list[Record]:
    """The runs of an engine, or of its family, that completed."""
    return [
        r
        for r in records
        if r["engine"] == engine and family in (None, r["family"]) and r["outcome"] == "COMPLETED"
    ]


def error(record: Record) -> float:
    """The error of a run; infinite where it is unknown."""
    value = record["metrics"].get("error")
    return float("inf") if value is None else float(value)


def best(records: Sequence[Record], engine: str, family: str | None = None) -> float | None:
    """The least error of an engine's completed runs; None where none completed."""
    done = completed(records, engine, family)
    return float(np.min([error(r) for r in done])) if done else None


def names(records: Sequence[Record]) -> list[str]:
    """The engines of the records."""
    return list(dict.fromkeys(r["engine"] for r in records))


def families(records: Sequence[Record], engine: str) -> list[str]:
    """The families of an engine."""
    return list(dict.fromkeys(r["family"] for r in records if r["engine"] == engine))


def graded(found: float | None) -> str:
    """The grade of a least error."""
    if found is None:
        return "failed"
    return "right" if found <= RIGHT else "inaccurate" if found <= WRONG else "wrong"


def cost(records: Sequence[Record], engine: str, families_used: Sequence[str]) -> tuple[float, str] | None:
    """Seconds in which the cheapest of some families reaches LEVEL, and its name; None where none does.

    A family's curve goes, in logarithms, through the runs that no run of the family beats in cost and error.
    """
    found = []
    for family in families_used:
        runs = [r for r in completed(records, engine, family) if np.isfinite(error(r))]
        points = np.array([(r["cost"]["seconds"], max(error(r), 1e-31)) for r in runs]).reshape(-1, 2)
        front = [p for p in points if not any((q <= p).all() and (q < p).any() for q in points)]
        if not front or min(e for _, e in front) > LEVEL:
            continue
        front.sort(key=lambda p: -p[1])
        costs, errors = np.log(np.array(front)).T
        found.append((float(np.exp(np.interp(-np.log(LEVEL), -errors, costs))), family))
    return min(found) if found else None


def headline(text: str, records: Sequence[Record], unlike: Sequence[str] = ()) -> None:
    """Check who is right at best and at the defaults, and which engines are ``unlike`` the scene."""
    said = text.removesuffix(".").split("; ")
    if unlike:
        named, verb = said.pop().removesuffix(" not judged: the adapter or the scene differs").rsplit(" ", 1)
        assert (engines(named), verb) == ([*unlike], "is" if len(unlike) == 1 else "are"), text
    if not records:
        assert not said, text
        return
    at_best, at_defaults = said
    at_best = re.sub(r"^Up to t = \S+ s, as far as the motion is known, ", "", at_best)
    all_of = names(records)
    right = [n for n in all_of if graded(best(records, n)) == "right"]
    if found := re.fullmatch(r"(?:[Bb]oth|[Aa]ll (\d+)) engines are right at their best settings", at_best):
        assert right == all_of and len(all_of) == int(found[1] or 2), (text, right)
    elif found := re.fullmatch(r"(.*) (is|are) right at (its|their) best settings", at_best):
        assert engines(found[1]) == right, (text, right)
        assert (found[2], found[3]) == (("is", "its") if len(right) == 1 else ("are", "their")), text
    else:
        assert at_best in [f"{n} engine is right at any setting that was run" for n in ("No", "no")], text
        assert not right, (text, right)
    shown = [n for n in all_of if "defaults" in families(records, n)]
    good = [n for n in shown if graded(best(records, n, "defaults")) == "right"]
    assert default_claims(at_defaults) == (sorted(shown), sorted(good)), (text, shown, good)


def default_claims(text: str) -> tuple[list[str], list[str]]:
    """The engines whose defaults a clause speaks of, and the engines whose defaults it says are right."""
    if text == "no library has defaults for it":
        return [], []
    if found := re.fullmatch(r"with its library's defaults (.*) is(, too| not)", text):
        only = engines(found[1])
        return only, only if found[2] == ", too" else []
    if found := re.fullmatch(r"with their libraries' defaults (?:neither|none of) (.*) is", text):
        return sorted(engines(found[1])), []
    if found := re.fullmatch(r"so are the libraries' defaults of (.*)", text):
        return sorted(engines(found[1])), sorted(engines(found[1]))
    found = re.fullmatch(r"with the libraries' defaults of (.*) only (.*) (?:is|are)", text)
    assert found, text
    return sorted(engines(found[1])), sorted(engines(found[2]))


def right(
    text: str, records: Sequence[Record], bound: float, unlike: Mapping[str, str] | None = None
) -> None:
    """Check the errors at best: every engine is in one sentence, or ``unlike`` the scene for a reason."""
    titles = {engine: title for title, engine in WRITTEN.items()}
    for name, reason in (unlike or {}).items():
        why = f"{titles.get(name, name)} is not judged, because the adapter or the scene differs: {reason}."
        assert text.count(why) == 1, (text, why)
        text = text.replace(why, "").strip()
    of = {n: best(records, n) for n in names(records)}
    good = [n for n, e in of.items() if graded(e) == "right"]
    said: list[str] = []
    for sentence in re.split(r"(?<=[\w)])\. ?(?=[A-Zm]|$)", text):
        if found := re.fullmatch(
            r"(.*) agrees? with the truth to (less than .* bound, )?(\S+?)(?: as far .*)?", sentence
        ):
            assert engines(found[1]) == good, (text, good)
            most = max(of[n] for n in good)  # type: ignore[type-var]
            limit = float(found[3])
            assert (
                limit == float(f"{bound:.0e}")
                if found[2]
                else most <= limit * (1 + 1e-12) < 1.1 * most + 1e-30
            )
            assert bool(found[2]) == (most < bound), (text, most)  # type: ignore[operator]
            said += good
        elif found := re.fullmatch(r"(.*) is (\w+) at best( of the .* (\S+) s)?: off by (.*)", sentence):
            [name] = engines(found[1])
            least = of[name]
            assert found[2] == graded(least) and least is not None, (sentence, least)
            assert found[5] in (f"{least:.2e}", f"< {bound:.0e}"), (sentence, least)
            late = [r for r in records if r["engine"] == name and r["outcome"] == "TIMED_OUT"]
            assert bool(late) == bool(found[3]), sentence
            assert not late or float(found[4]) == max(r["time_limit"] for r in late), sentence
            said.append(name)
        elif sentence:
            found = re.fullmatch(r"(.*) completes no run: (.*)", sentence)
            assert found and of[engines(found[1])[0]] is None, sentence
            farthest(found[2], [r for r in records if r["engine"] == engines(found[1])[0]])
            said += engines(found[1])
    assert sorted(said) == sorted(of), (text, said)


def farthest(text: str, records: Sequence[Record]) -> None:
    """Check the end of an engine that completes no run: the end of the run that came farthest."""
    last = max(r["t_end"] for r in records)
    ends = [r for r in records if r["t_end"] == last]
    words = [
        f"no result within {r['time_limit']:g} s (--time-limit)"
        if r["outcome"] == "TIMED_OUT"
        else f"{r['outcome'].lower().replace('_', ' ')} at t = {last:.3g} s"
        for r in ends
    ]
    assert text in words, (text, words)


def fast(
    text: str, records: Sequence[Record], ours: Mapping[str, Sequence[str]], unlike: Sequence[str] = ()
) -> None:
    """Check the times, their ratios and whose integrators they are of; ``ours`` are crosscheck's families.

    Engines ``unlike`` the scene have no times, but the note on compiled families is of all runs.
    """
    costs = {n: cost(records, n, families(records, n)) for n in names(records) if n not in unlike}
    reached = {n: c for n, c in costs.items() if c is not None}
    if not reached:
        assert text.startswith("No engine reaches an error of 1e-6"), text
        return
    first = re.match(
        r"(.*?)(, integrated by crosscheck,)? reaches an error of 1e-6 in (\S+ \S+) of step", text
    )
    assert first, text
    [fastest] = engines(first[1])
    least = min(c for c, _ in reached.values())
    assert reached[fastest][0] == least, (text, reached)
    assert bool(first[2]) == (reached[fastest][1] in ours.get(fastest, ())), text
    assert in_seconds(first[3]) == rounded(least), (text, least)
    said = {
        engines(n)[0]: m for n, m in re.findall(r"([\w ]+?) takes (\S+) times as long", said_of_others(text))
    }
    assert sorted(said) == sorted(set(reached) - {fastest}), (text, reached)
    for name, multiple in said.items():
        true = reached[name][0] / least
        assert float(multiple) == float(f"{true:.1f}" if true < 9.95 else f"{true:.0f}"), (text, name, true)
    is_compiled = [r["family"].endswith(", compiled") for r in records]
    assert ("called by crosscheck's Python adapter" in text) == any(is_compiled), text
    never = re.search(r"\. ([^.]*?) do(?:es)? not reach it\.", text)
    assert (engines(never[1]) if never else []) == [n for n, c in costs.items() if c is None], text
    for name, (_, family) in reached.items():
        by_crosscheck(text, records, name, family, ours.get(name, ()))


def said_of_others(text: str) -> str:
    """The clause on the slower engines."""
    found = re.search(r"of stepping; (.*? as long)\.", text)
    return found[1].replace(" and ", ", ").replace(", ", " , ") if found else ""


def by_crosscheck(text: str, records: Sequence[Record], name: str, family: str, ours: Sequence[str]) -> None:
    """Check the sentence on an engine whose fastest family crosscheck integrates."""
    titles = {engine: title for title, engine in WRITTEN.items()}
    start = f"{titles.get(name, name)}'s fastest runs are integrated by crosscheck (“{family}”)"
    assert (start in text) == (family in ours), (text, name, family)
    if family not in ours:
        return
    end = text.split(start)[1]
    own = [f for f in families(records, name) if f not in ours]
    there = cost(records, name, own)
    if not own:
        assert end.startswith(", as all of its runs here are."), text
    elif there is None:
        assert end.startswith(f"; the runs by its own integrators ({quoted(own)}) do not reach 1e-6."), text
    else:
        said = re.match(r"; its own integrator needs (\S+ \S+) \(“(.*?)”\)\.", end)
        assert said and said[2] == there[1] and in_seconds(said[1]) == rounded(there[0]), (text, there)


def quoted(names: Sequence[str]) -> str:
    """Return ``“a”, “b” and “c”``."""
    return " and ".join(filter(None, [", ".join(f"“{n}”" for n in names[:-1]), f"“{names[-1]}”"]))


def in_seconds(text: str) -> float:
    """Return the number of ``3.7 ms`` in seconds, with three digits."""
    number, unit = text.split()
    return rounded(float(number) * {"s": 1.0, "ms": 1e-3, "µs": 1e-6}[unit])


def rounded(value: float) -> float:
    """Return a number with three digits."""
    return float(f"{value:.3g}")


def breaks(text: str, records: Sequence[Record]) -> None:
    """Check the defaults that fail or are wrong, and the counts of other runs."""
    shown = [n for n in names(records) if "defaults" in families(records, n)]
    grades = {n: graded(best(records, n, "defaults")) for n in shown}
    lost = [n for n in shown if grades[n] == "failed"]
    off = [n for n in shown if grades[n] == "wrong"]
    failed = re.match(r"The defaults of (.*?) (?:end at t = (\S+) s|do not \w+)", text)
    assert (engines(failed[1]) if failed else []) == lost, (text, lost)
    if failed and failed[2]:
        ends = {
            max(r["t_end"] for r in records if r["engine"] == n and r["family"] == "defaults") for n in lost
        }
        assert {f"{t:.3g}" for t in ends} == {failed[2]}, (text, ends)
    said = dict(re.findall(r"(\S+(?: IDA)?)'s defaults complete, but with an error of (\S+) at best", text))
    assert {engines(n)[0]: e for n, e in said.items()} == {
        n: f"{best(records, n, 'defaults'):.2g}" for n in off
    }, text
    near = [n for n in shown if grades[n] == "inaccurate"]
    said = dict(re.findall(r"(\S+(?: IDA)?)'s defaults are inaccurate, with an error of (\S+) at best", text))
    assert {engines(n)[0]: e for n, e in said.items()} == {
        n: f"{best(records, n, 'defaults'):.2g}" for n in near
    }, text
    all_right = bool(shown) and not lost and not off and not near
    assert bool(re.search(r"The defaults of .* are right\.", text)) == all_right, text
    assert ("No run used a library's default settings." in text) == (not shown), text
    others = [r for r in records if r["family"] != "defaults"]
    counts = re.search(
        r"Of (\d+) runs at other settings, (?:(\d+) failed)?(?: and )?(?:(\d+) (?:is|are) wrong)?", text
    )
    bad = sum(r["outcome"] != "COMPLETED" for r in others)
    wrong = sum(r["outcome"] == "COMPLETED" and error(r) > WRONG for r in others)
    assert bool(counts) == bool(bad or wrong), text
    if counts:
        assert [int(c or 0) for c in counts.groups()] == [len(others), bad, wrong], text
