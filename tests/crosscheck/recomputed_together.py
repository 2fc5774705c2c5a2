"""The statements of a verdict on several scenes, recomputed from records by other code than the verdict's."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from tests.crosscheck.recomputed import (
    WRITTEN,
    best,
    completed,
    cost,
    default_claims,
    engines,
    error,
    families,
    graded,
    names,
)

Record = Mapping[str, Any]
Records = Mapping[str, Sequence[Record]]  # by scene
ORDER = ("right", "inaccurate", "wrong", "failed")


def scenes_of(listed: str) -> list[str]:
    """The scenes of ``a, b and c``."""
    return re.split(r", | and ", listed)


def all_names(records: Records) -> list[str]:
    """The engines of all scenes."""
    return list(dict.fromkeys(name for some in records.values() for name in names(some)))


def worst(records: Records, engine: str, family: str | None = None) -> str:
    """The worst grade of an engine over the scenes that it runs, or of one of its families."""
    found = [
        graded(best(some, engine, family))
        for some in records.values()
        if engine in names(some) and (family is None or family in families(some, engine))
    ]
    return max(found, key=ORDER.index)


def runs_all(records: Records, chosen: Sequence[str]) -> bool:
    """Whether each engine has runs of each scene."""
    return all(name in names(some) for name in chosen for some in records.values())


def where(records: Records, chosen: Sequence[str]) -> str:
    """The words for the scenes on which all of these engines run."""
    if not runs_all(records, chosen):
        return f"on the scenes {'they' if len(chosen) > 1 else 'it'} can run"
    return "on both scenes" if len(records) == 2 else f"on all {len(records)} scenes"


def headline(text: str, records: Records) -> None:
    """Check who is right on all scenes, at best and at the defaults."""
    at_best, at_defaults = text.removesuffix(".").split("; ")
    right = [n for n in all_names(records) if worst(records, n) == "right"]
    if right:
        found = re.fullmatch(r"(.*) (?:is|are) right at (?:its|their) best settings (on .*)", at_best)
        assert found and found[2] == where(records, right), (text, right)
        every = {"Both engines", f"All {len(right)} engines"}
        said = all_names(records) if found[1] in every else engines(found[1])
        assert sorted(said) == sorted(right), (text, right)
    else:
        assert at_best == "No engine is right on every scene at any setting that was run", text
    shown = [n for n in all_names(records) if any("defaults" in families(r, n) for r in records.values())]
    good = [n for n in shown if worst(records, n, "defaults") == "right"]
    assert default_claims(at_defaults) == (sorted(shown), sorted(good)), (text, shown, good)


def right(text: str, records: Records, bound: float) -> None:
    """Check the errors at best, each with its scene."""
    good = [n for n in all_names(records) if worst(records, n) == "right"]
    said = []
    for sentence in re.split(r"(?<=[\w)])\. ?(?=[A-Zm]|$)", text):
        if found := re.fullmatch(r"(.*) agrees? with the truth to (.*?) (on .*)", sentence):
            assert engines(found[1]) == good and found[3] == where(records, good), (text, good)
            most = max(best(some, n) or 0.0 for some in records.values() for n in good if n in names(some))
            limit = float(found[2].split()[-1])
            is_below = found[2].startswith("less than")
            assert is_below == (most < bound), (text, most)
            assert limit == float(f"{bound:.0e}") if is_below else most <= limit <= 1.1 * most, (text, most)
            said += good
        elif found := re.fullmatch(r"(\S+(?: IDA)?) completes no run (.*)", sentence):
            [name] = engines(found[1])
            ends = re.findall(r"on (\S+): ([^,;]+(?: \(--time-limit\))?)", found[2])
            lost = [s for s, some in records.items() if name in names(some) and not completed(some, name)]
            assert [scene for scene, _ in ends] == lost, (sentence, lost)
            for scene, words in ends:
                assert words in ends_of([r for r in records[scene] if r["engine"] == name]), (sentence, scene)
            said.append(name)
        elif sentence:
            found = re.fullmatch(r"(.*) is (\w+) at best( of .*? s)? on (\S+): off by (.*)", sentence)
            assert found, sentence
            [name] = engines(found[1])
            errors = {s: best(some, name) for s, some in records.items() if name in names(some)}
            farthest = max(errors, key=lambda scene: errors[scene] or 0.0)
            assert found[4] == farthest and found[2] == graded(errors[farthest]), (sentence, errors)
            assert found[5] in (f"{errors[farthest]:.2e}", f"< {bound:.0e}"), (sentence, errors)
            said.append(name)
    assert sorted(said) == sorted(all_names(records)), (text, said)


def ends_of(records: Sequence[Record]) -> list[str]:
    """The words for the ends of the runs that came farthest."""
    last = max(r["t_end"] for r in records)
    return [
        f"no result within {r['time_limit']:g} s (--time-limit)"
        if r["outcome"] == "TIMED_OUT"
        else f"{r['outcome'].lower().replace('_', ' ')} at t = {last:.3g} s"
        for r in records
        if r["t_end"] == last
    ]


def fast(text: str, records: Records, ours: Mapping[str, Sequence[str]]) -> None:
    """Check who is the fastest on how many scenes, by how much, and by whose integrator."""
    costs: dict[str, dict[str, tuple[float, str]]] = {}
    for scene, some in records.items():
        found = {n: c for n in names(some) if (c := cost(some, n, families(some, n))) is not None}
        if found:
            costs[scene] = found
    if not costs:
        assert text.startswith("No engine reaches an error of 1e-6"), text
        return
    winners = {scene: min(found, key=lambda n: found[n][0]) for scene, found in costs.items()}
    said = re.match(
        r"(.*?)(, integrated by crosscheck,)? is the fastest to an error of 1e-6 on (.*?)(?=[;.] )", text
    )
    assert said, text
    [first] = engines(said[1])
    wins = [scene for scene, name in winners.items() if name == first]
    most = max(list(winners.values()).count(name) for name in winners.values())
    assert len(wins) == most, (text, winners)
    assert said[3] == where_won(wins, len(costs), len(records)), text
    by_ours = [costs[scene][first][1] in ours.get(first, ()) for scene in wins]
    assert bool(said[2]) == all(by_ours), (text, by_ours)
    ratios = [
        min(c for n, (c, _) in costs[scene].items() if n != first) / costs[scene][first][0]
        for scene in wins
        if len(costs[scene]) > 1
    ]
    shown = re.search(r"the best other engine takes (\S+)(?: to (\S+))? times as long", text)
    assert bool(shown) == bool(ratios), (text, ratios)
    if shown:
        low, high = ((f"{r:.1f}" if r < 9.95 else f"{r:.0f}") for r in (min(ratios), max(ratios)))
        assert (shown[1], shown[2] or shown[1]) == (low, high), (text, ratios)
    rest = re.search(r"On all other scenes the fastest is (.*?)\. ?(?=[A-Z]|$)", text)
    others = {scene: name for scene, name in winners.items() if name != first}
    assert bool(rest) == bool(others), (text, others)
    if rest:
        titles = {engine: title for title, engine in WRITTEN.items()}
        for name in dict.fromkeys(others.values()):
            places = [scene for scene, winner in others.items() if winner == name]
            listed = " and ".join(filter(None, [", ".join(places[:-1]), places[-1]]))
            assert f"{titles.get(name, name)} on {listed}" in rest[1], (text, name)
    never = re.search(r"\. ([^.]*?) do(?:es)? not reach it\.", text)
    slow = [n for n in all_names(records) if not any(n in found for found in costs.values())]
    assert (engines(never[1]) if never else []) == slow, (text, slow)


def where_won(wins: Sequence[str], reached: int, scenes: int) -> str:
    """The words for the scenes of the fastest engine."""
    if reached == 1:
        return f"{wins[0]}, the only scene on which an engine reaches it"
    the, end = ("the ", " on which an engine reaches it") if reached < scenes else ("", "")
    every = "both" if reached == 2 else f"all {reached}"
    return (every if len(wins) == reached else f"{len(wins)} of {the}{reached}") + f" scenes{end}"


def breaks(text: str, records: Records) -> None:
    """Check the defaults that fail or are wrong, with their scenes, and the counts of other runs."""
    for grade, pattern in (
        (
            "failed",
            r"The defaults of ([^.]*?) (?:end at t = \S+ s|do not .*?)( on [^.]*?)?(?:, where [^.]*)?\.",
        ),
        ("wrong", r"(\S+(?: IDA)?)'s defaults complete( on .*?)?, but with an error of "),
        ("inaccurate", r"(\S+(?: IDA)?)'s defaults are inaccurate( on .*?)?, with an error of "),
    ):
        true = {
            (name, scene)
            for scene, some in records.items()
            for name in names(some)
            if "defaults" in families(some, name) and graded(best(some, name, "defaults")) == grade
        }
        said = set()
        for listed, places in re.findall(pattern, text):
            on = re.sub(r"^ on ", "", places)
            scenes = [*records] if on in ("both scenes", f"all {len(records)} scenes") else scenes_of(on)
            if on.endswith("can run"):
                scenes = [*records]
            said |= {
                (name, scene) for name in engines(listed) for scene in scenes if name in names(records[scene])
            }
        assert said == true, (grade, text, true)
    others = [r for some in records.values() for r in some if r["family"] != "defaults"]
    bad = sum(r["outcome"] != "COMPLETED" for r in others)
    wrong = sum(r["outcome"] == "COMPLETED" and error(r) > 1e-2 for r in others)
    counts = re.search(
        r"Of (\d+) runs at other settings, (?:(\d+) failed)?(?: and )?(?:(\d+) (?:is|are) wrong)?", text
    )
    assert bool(counts) == bool(bad or wrong), text
    if counts:
        assert [int(c or 0) for c in counts.groups()] == [len(others), bad, wrong], text
