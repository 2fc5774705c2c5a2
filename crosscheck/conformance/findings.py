"""Violations found by the suite: reduced to a small scene and stored with the command that repeats the
check."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
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
from mbref.scene import GROUND, Joint, Load, Scene, SceneError

TRIES = 60  # largest number of scenes tried to reduce a violation


def violates(runner: Runner, check: str) -> Callable[[Scene], bool]:
    """Return whether the runner's engine fails a check on a scene."""

    def fails(scene: Scene) -> bool:
        bench = set_up(runner, Specimen(scene, None, True))
        return not bench.cannot and suite.verdict_on(check, bench).status == suite.FAIL

    return fails


def shrunk(scene: Scene, fails: Callable[[Scene], bool], tries: int = TRIES) -> Scene:
    """Return the smallest scene found on which the check still fails.

    Loads, drivers, joints and bodies are removed, the duration is shortened and numbers are rounded. If no
    reduction still fails, the scene itself is returned.
    """
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
    small = shrunk(bench.scene, violates(bench.runner, verdict.property))
    again = verdict
    if small != bench.scene:
        again = suite.verdict_on(verdict.property, set_up(bench.runner, Specimen(small, None, True)))
    return keep(small, replace(again, scene=small.name), bench.runner.name, folder)


def _smaller(scene: Scene) -> Iterator[Scene]:
    """Yield valid smaller scenes, starting with the largest reductions."""
    for candidate in (*_without_bodies(scene), *_without_items(scene), *_simpler(scene)):
        try:
            smaller = candidate()
        except SceneError:
            continue
        if smaller != scene:
            yield smaller


def _without_bodies(scene: Scene) -> list[Callable[[], Scene]]:
    def without(name: str) -> Scene:
        def kept(item: Joint | Load) -> bool:
            return name not in (getattr(item, "body", None), *getattr(item, "bodies", ()))

        joints = tuple(filter(kept, scene.joint))
        names = {joint.name for joint in joints}
        return scene.with_(
            body=tuple(body for body in scene.body if body.name != name),
            joint=joints,
            driver=tuple(d for d in scene.driver if d.joint in names),
            load=tuple(x for x in scene.load if kept(x) and getattr(x, "joint", None) in (*names, None)),
        )

    names = [body.name for body in scene.body] if len(scene.body) > 1 else []
    return [partial(without, name) for name in names if name != GROUND]


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
