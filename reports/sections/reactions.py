"""Section: joint reactions of the engines compared with the exact reactions where these are unique, and the
shares of redundant joints in the loads."""

from __future__ import annotations

from collections.abc import Mapping

from crosscheck.judge.joint_reactions import Comparison, compare, largest_reaction, side_by_side
from crosscheck.judge.reaction_balance import absurd, with_exact_reactions
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

from ..blocks import Block, Heading, Table, Text
from ..runs import ROUNDING, Run, SceneRuns, beyond_rounding, number

CAPTION = (
    "Largest difference from the reactions of the exact motion, relative to the largest of them, over "
    "samples of the run of least error of every engine; moments count divided by the mechanism's length. "
    "Compared are the components that redundancy leaves unique ('open' counts the dimensions it leaves open),"
    " and, in the last row, the resultant of all joints on a body, which is always unique."
)
SHARES = (
    "The engine's choice: size (N) at t = {t:.3g} s of the components that redundancy leaves undetermined. "
    "They need "
    "not agree, and none of them is wrong."
)
UNUSED = "At t = {t:.3g} s the components that redundancy leaves undetermined are 0 in every engine."


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return tables of differences and of undetermined components, and sentences on implausible reactions.

    The result is empty without reactions or without a known motion.
    """
    scene = scene_runs.scene
    runs = {engine: run.trajectory for engine, run in _best(scene_runs).items()}
    found: dict[str, Comparison] = {}
    sentences: list[Block] = []
    solved: dict[bytes, Trajectory] = {}  # exact motions with reactions, by sample times
    for engine, run in runs.items():
        exact = scene_runs.exact(run.times)
        if exact is not None and exact.acceleration is not None and scene.has_mass():
            key = exact.times.tobytes()
            true = solved[key] = solved.get(key) or with_exact_reactions(scene, exact)
            found[engine] = compare(scene, true, run)
            sentences += [Text(f"{sentence}.") for sentence in absurd(scene, run, true)]
    if not found:
        return []
    table = Table(CAPTION, ("Joint", "Open", *found), _rows(scene, found), right=_numbers(len(found) + 2))
    return [Heading("Joint reactions"), table, *sentences, *_choices(scene, runs)]


def _best(scene_runs: SceneRuns) -> dict[str, Run]:
    """Return for each engine the completed run with reactions that has the least error."""
    best: dict[str, Run] = {}
    for run in scene_runs.best().values():
        engine = run.curve[0]
        if run.completed and run.record["reactions"]:
            best[engine] = min(best.get(engine, run), run, key=lambda r: r.by_error)
    return best


def _rows(scene: Scene, found: Mapping[str, Comparison]) -> list[tuple[str, ...]]:
    rows = []
    for joint in scene.joint:
        reactions = [comparison.joints[joint.name] for comparison in found.values()]
        rows.append((joint.name, str(reactions[0].shared), *(beyond_rounding(r.unique) for r in reactions)))
    return [
        *rows,
        ("on a body", "0", *(beyond_rounding(comparison.resultant) for comparison in found.values())),
    ]


def _choices(scene: Scene, runs: Mapping[str, Trajectory]) -> list[Block]:
    samples = min(len(motion.times) for motion in runs.values())
    shares = side_by_side(scene, runs, samples // 2)
    if not shares:
        return []
    time = next(iter(runs.values())).times[samples // 2]
    least = ROUNDING * max(largest_reaction(scene, run) for run in runs.values())
    rows = [
        (joint, *("0" if size < least else number(size, 4) for size in sizes.values()))
        for joint, sizes in shares.items()
    ]
    if all(set(sizes) == {"0"} for _, *sizes in rows):
        return [Text(UNUSED.format(t=time))]
    return [Table(SHARES.format(t=time), ("Joint", *runs), rows, right=_numbers(len(runs) + 1))]


def _numbers(columns: int) -> frozenset[int]:
    """Return the columns after the first one."""
    return frozenset(range(1, columns))
