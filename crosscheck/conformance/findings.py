"""Violations found by the suite: reduced to a small scene and stored with the command that repeats the
check."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from crosscheck.conformance import suite
from crosscheck.conformance.changes.copies import replaced
from crosscheck.conformance.mechanisms.specimens import Specimen
from crosscheck.conformance.runners import Runner
from crosscheck.conformance.trial import Bench, set_up
from mbref.files import file_name
from mbref.scene import Joint, Load, Scene, SceneError

TRIES = 60  # largest number of scenes tried to reduce a violation
# number of bodies above which bodies are removed in groups first, and number of scenes tried for that
MANY, MANY_TRIES = 8, 400
SAME_KIND = 0.1  # part of a violation that remains if it is still of the same cause, not rounding


def violates(runner: Runner, check: str, large: bool = False, least: float = 0.0) -> Callable[[Scene], bool]:
    """Return whether the runner's engine fails a check on a scene, with a value of at least ``least``."""

    def fails(scene: Scene) -> bool:
        bench = set_up(runner, Specimen(scene, None, True, large=large))
        verdict = None if bench.cannot else suite.verdict_on(check, bench)
        if verdict is None or verdict.status != suite.FAIL:
            return False
        return verdict.measured is None or verdict.measured >= least

    return fails


def shrunk(scene: Scene, fails: Callable[[Scene], bool], tries: int = TRIES) -> Scene:
    """Return the smallest scene found on which the check still fails.

    Loads, drivers, joints and bodies are removed, the duration is shortened and numbers are rounded. Of many
    bodies, groups are removed or united with their neighbours first. If no reduction still fails, the scene
    itself is returned.
    """
    if len(scene.body) > MANY:
        scene = fewer_bodies(scene, fails)
    left, found = tries, True
    while found:
        found = False
        for smaller in _smaller(scene):
            left -= 1
            if left < 0:
                break
            if fails(smaller):
                scene, found = smaller, True
                break
    return scene


def keep(scene: Scene, verdict: suite.Verdict, engine: str, folder: Path, called: str = "") -> Path:
    """Write a scene file whose comments describe the violation and the command that repeats the check; return
    its path.

    ``called`` names a scene of the suite, which the command then uses in place of the file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{file_name(f'{engine}_{verdict.property}_{scene.name}')}.toml"
    scene.save(path)
    numbers = "" if verdict.measured is None else f" {verdict.measured:.3g}, allowed {verdict.allowed:.3g}"
    words = [
        f"{engine}: {verdict.check()} fails{numbers} {verdict.reason}".rstrip(),
        shlex.join(["crosscheck", "verify", engine, "--scene", called or str(path)]),
    ]
    path.write_text("".join(f"# {word}\n" for word in words) + path.read_text())
    return path


def found(bench: Bench, verdict: suite.Verdict, folder: Path) -> Path:
    """Reduce a violation and store it; return the file's path."""
    if bench.specimen.dead_end:  # a smaller scene may lose its dead end
        return keep(bench.scene, verdict, bench.runner.name, folder, bench.scene.name)
    large = bench.specimen.large
    least = SAME_KIND * (verdict.measured or 0.0) if large else 0.0
    small = shrunk(bench.scene, violates(bench.runner, verdict.property, large, least))
    again = verdict
    if small != bench.scene:
        specimen = Specimen(small, None, True, large=large)
        again = suite.verdict_on(verdict.property, set_up(bench.runner, specimen))
    return keep(small, replace(again, scene=small.name), bench.runner.name, folder)


def _smaller(scene: Scene) -> Iterator[Scene]:
    """Yield valid smaller scenes, starting with the largest reductions."""
    for candidate in (*_without_bodies(scene), *_without_items(scene), *_simpler(scene)):
        smaller = _valid(candidate)
        if smaller and smaller != scene:
            yield smaller


def fewer_bodies(scene: Scene, fails: Callable[[Scene], bool], tries: int = MANY_TRIES) -> Scene:
    """Return a scene with fewer bodies on which the check still fails.

    Groups of ever fewer bodies are removed, or united with a neighbour, which shortens loops and keeps them.
    Bodies are at rest if the check fails on them at rest.
    """
    left = tries
    still = scene.with_(body=tuple(replaced(b, velocity=None, angular_velocity=None) for b in scene.body))
    scene = still if fails(still) else scene
    size = len(scene.body) // 2
    while size and left > 0:
        start, before = 0, len(scene.body)
        while start < len(scene.body) > size and left > 0:
            names = [body.name for body in scene.body[start : start + size]]
            for change in (_without, _united):
                smaller = _valid(partial(change, scene, names))
                left -= 1
                if smaller and fails(smaller):
                    scene = smaller
                    break
            else:
                start += size
        size = size // 2 if size > 1 or len(scene.body) == before else 1
    return scene


def _valid(candidate: Callable[[], Scene]) -> Scene | None:
    try:
        return candidate()
    except SceneError:
        return None


def _united(scene: Scene, names: Sequence[str]) -> Scene:
    """Return the scene without some bodies; each gives its joints to a body that a joint connects with it."""
    for name in names:
        ends = next((joint.bodies for joint in scene.joint if name in joint.bodies), ())
        other = next((end for end in ends if end != name), "")
        if not other:
            continue
        moved = [
            replaced(joint, bodies=tuple(other if end == name else end for end in joint.bodies))
            for joint in scene.joint
            if {*joint.bodies} != {name, other}
        ]
        scene = _without(scene.with_(joint=tuple(moved)), [name])
    return scene


def _without(scene: Scene, names: Sequence[str]) -> Scene:
    """Return the scene without some bodies, their joints and loads."""

    def kept(item: Joint | Load) -> bool:
        return not {getattr(item, "body", None), *getattr(item, "bodies", ())} & {*names}

    joints = tuple(filter(kept, scene.joint))
    left = {joint.name for joint in joints}
    return scene.with_(
        body=tuple(body for body in scene.body if body.name not in names),
        joint=joints,
        driver=tuple(d for d in scene.driver if d.joint in left),
        load=tuple(x for x in scene.load if kept(x) and getattr(x, "joint", None) in (*left, None)),
    )


def _without_bodies(scene: Scene) -> list[Callable[[], Scene]]:
    names = [body.name for body in scene.body] if len(scene.body) > 1 else []
    return [partial(_without, scene, [name]) for name in names]


def _without_items(scene: Scene) -> list[Callable[[], Scene]]:
    def without(kind: str, k: int) -> Scene:
        items = getattr(scene, kind)
        return scene.with_(**{kind: items[:k] + items[k + 1 :]})

    return [
        partial(without, kind, k)
        for kind in ("load", "driver", "joint")
        for k in range(len(getattr(scene, kind)))
    ]


def _simpler(scene: Scene) -> list[Callable[[], Scene]]:
    def rounded(value: Any, digits: int) -> Any:
        if isinstance(value, float):
            return round(value, digits)
        return tuple(rounded(v, digits) for v in value) if isinstance(value, tuple) else value

    def bodies(**fields: Any) -> Scene:
        return scene.with_(body=tuple(replaced(body, **fields) for body in scene.body))

    def round_bodies(digits: int) -> Scene:
        names = ("mass", "inertia", "velocity", "angular_velocity")
        return scene.with_(
            body=tuple(replaced(b, **{n: rounded(getattr(b, n), digits) for n in names}) for b in scene.body)
        )

    return [
        lambda: scene.with_(gravity=(0.0, 0.0, 0.0)),
        lambda: bodies(velocity=None, angular_velocity=None),
        lambda: scene.with_(duration=scene.duration / 2),
        *(partial(round_bodies, digits) for digits in (1, 2)),
    ]
