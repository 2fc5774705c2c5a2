"""Section: the top of the page with the verdict in words, the animated mechanism, and the matrix of scenes
and engines."""

from __future__ import annotations

from collections.abc import Sequence

import mbref
from crosscheck.judge.tolerances import FALSE_SUCCESS, FLOOR
from crosscheck.study.grades import DEFAULTS, Grade, Judged, grade
from crosscheck.study.record_view import ended
from crosscheck.study.words.speed import title
from crosscheck.study.words.verdict import verdict

from .. import places
from ..blocks import Block, Heading, Matrix, Opening, Verdict
from ..engine_looks import SIGNS, mark, named, tone
from ..mechanisms import motion_of, over_truth
from ..runs import Run, SceneRuns, duration, power, short
from ..sections import speed

KEY = (
    f"= right: error up to {short(FLOOR)}; ≈ inaccurate: up to {short(FALSE_SUCCESS)}; ≠ wrong: above, "
    "although the run completes; × failed: no run completes. A cell has the engine's run of least error and "
    "the time of its steps; where the library's defaults are another family, they stand below it. A cell "
    "leads to that run, its version and command; an empty one: the engine cannot run the scene (Support)."
)


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return the opening and the matrix; only the matrix if no truth was recorded."""
    known = [judged(group) for group in groups if group.truth]
    matrix = Matrix(
        KEY,
        _engines(groups),
        [_scene(group) for group in groups],
        {group.scene.name: _row(group) for group in groups},
    )
    chapter: list[Block] = [Heading("Every scene in every engine", 2), matrix]
    if not known:
        return [*chapter]
    said, group = verdict(known), _shown(groups)
    shown, caption = motion(group)
    opening = Opening(said.headline, said.labelled(), shown, caption)
    return [opening, *chapter, *([] if group is None else _figure(group))]


def _figure(group: SceneRuns) -> list[Block]:
    """Return the figure of time against error for the scene that is animated."""
    _, figure, *_ = speed.render(group)
    return [Heading(f"Time against error: {group.scene.name}", 2), figure]


def judged(group: SceneRuns) -> Judged:
    """Return a scene's runs in the form that the sentences of the verdict need."""
    assert group.truth is not None
    return Judged(group.scene, group.truth, [run.record for run in group.runs], group.differences)


def motion(group: SceneRuns | None) -> tuple[str, str]:
    """Return the animation of a scene's true motion and its worst run, with its caption; empty without a
    truth."""
    if group is None or not (group.truth and group.truth["motion"]):
        return "", ""
    exact = motion_of(group.scene, group.truth["motion"])
    worst = group.motion if group.motion and len(group.motion["times"]) == len(exact.times) else None
    run, engine = (motion_of(group.scene, worst), worst["engine"]) if worst else (None, "")
    shown = over_truth(group.scene, exact, run, engine)
    end = exact.times[-1]
    part = f"the first {end:.3g} s" if end < 0.999 * group.scene.duration else f"{end:.3g} s"
    caption = f"{group.scene.name}, {part} of its true motion as thick lines."
    if worst:
        name = named(worst["engine"], worst["family"])
        caption += f" Coloured: the completed run of largest error, {name}, off by {power(_largest(group))}."
    return shown, caption


def _shown(groups: Sequence[SceneRuns]) -> SceneRuns | None:
    """Return the scene whose worst completed run has the largest error, among scenes that can be animated."""
    able = [group for group in groups if group.motion and group.truth and group.truth["motion"]]
    return max(able, key=_largest, default=None)


def _largest(group: SceneRuns) -> float:
    """Return the largest error of a completed run."""
    return max((run.error for run in group.completed() if run.error == run.error), default=0.0)


def _engines(groups: Sequence[SceneRuns]) -> list[tuple[str, str, int, str]]:
    names = dict.fromkeys(engine for group in groups for engine, _ in group.curves())
    return [(name, title(name), tone(name), mark(name)) for name in names]


def _scene(group: SceneRuns) -> tuple[str, str]:
    counts = mbref.counts(group.scene)
    redundant = f"{counts.redundant} redundant" if counts.redundant else "none redundant"
    return group.scene.name, f"{group.scene.duration:g} s, {counts.rows} rows, {redundant}"


def _row(group: SceneRuns) -> dict[str, list[Verdict]]:
    """Return for each engine the best family, and the library's defaults if the defaults are another family
    of settings."""
    best = group.best()
    found: dict[str, list[Verdict]] = {}
    for engine in dict.fromkeys(engine for engine, _ in best):
        own = [run for (name, _), run in best.items() if name == engine]
        first = min(own, key=lambda run: (not run.completed, run.by_error))
        others = [run for run in own if run.curve[1] == DEFAULTS and run is not first]
        found[engine] = [_verdict(group, run) for run in (first, *others)]
    return found


def _verdict(group: SceneRuns, run: Run) -> Verdict:
    is_judged = run.curve[0] not in group.differences
    found, runs = grade(run.record) if is_judged else Grade.UNJUDGED, group.curves()[run.curve]
    lines = [run.said, duration(run.seconds)] if run.completed else [ended(run.record)]
    if failed := sum(not other.completed for other in runs) * run.completed:
        lines.append(f"{failed} of {len(runs)} failed")
    place, href = places.of_cell(group.scene.name, run.curve), f"#{places.of_run(run)}"
    return Verdict(run.curve[1], str(found), SIGNS[found], lines, place, href)
