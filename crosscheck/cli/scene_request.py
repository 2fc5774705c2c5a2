"""Scenes of a command line: built-in ones, scene files, and files of other programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from crosscheck.judge.constraints import initial_twists
from crosscheck.judge.pieces import at_start
from crosscheck.judge.start import started
from crosscheck.study.search.offers import remember
from mbref import formats
from mbref.formats import ImportOptions
from mbref.scene import GROUND, Fixed, Scene, SceneError
from mbref.scene.fields import meant
from mbref.scene.toml import with_lines
from mbref.scenes import SCENES, find_scene


class RequestError(Exception):
    """A request that cannot be carried out; ``faults`` has one line for each fault."""

    def __init__(self, *faults: str):
        self.faults = faults
        super().__init__("\n".join(faults))


Notice = Callable[[str], None]  # takes one sentence for the user


def find_scenes(
    names: Sequence[str], reading: ImportOptions | None = None, notice: Notice = lambda _: None
) -> list[Scene]:
    """Return the scenes of the given names at the poses at which their motions start (see ``started``).

    Raises RequestError as ``read_scenes``.
    """
    return [started(scene) for scene in read_scenes(names, reading, notice)]


def read_scenes(
    names: Sequence[str], reading: ImportOptions | None = None, notice: Notice = lambda _: None
) -> list[Scene]:
    """Return the scenes of the given names as their files give them.

    Raises RequestError with every fault of every scene, and if two scenes have the same name. A file of
    another program is read with the options ``reading``; ``notice`` reports the parts of the file that the
    scene does not contain.
    """
    scenes, faults, asked = [], [], replace(reading or ImportOptions(), say=notice)
    for name in names:
        try:
            scenes.append(_started(name, asked, notice))
        except SceneError as error:
            several = f"{name}: " if len(names) > 1 else ""
            faults += [several + fault for fault in error.faults]
    if faults:
        raise RequestError(*faults)
    called = [scene.name for scene in scenes]
    if twice := sorted({name for name in called if called.count(name) > 1}):
        raise RequestError(*(f"scene {name!r} is asked for twice" for name in twice))
    return scenes


def _started(name: str, reading: ImportOptions, notice: Notice) -> Scene:
    """Return the scene.

    Raises SceneError with line numbers if the initial velocities of its file contradict its joints.
    """
    if formats.is_readable(name) or _is_xml(name):
        return _imported(name, reading, notice)
    scene = held(find_scene(name), reading.hold)
    if name not in SCENES and Path(name).exists():
        try:
            initial_twists(at_start(started(scene)))
        except SceneError as error:
            raise SceneError(with_lines(Path(name).read_text(encoding="utf-8-sig"), error.faults)) from None
    return scene


def _is_xml(name: str) -> bool:
    """Return whether a name is of a file that begins like XML, which no scene file does."""
    path = Path(name)
    return path.is_file() and path.read_bytes()[:64].lstrip().startswith(b"<")


def _imported(name: str, reading: ImportOptions, notice: Notice) -> Scene:
    """Return the scene in another program's file; the engines then also offer runs of the file's own
    model."""
    try:
        found = formats.read(name, reading)
    except (OSError, ValueError) as error:
        raise SceneError([str(error)]) from None
    for sentence in found.left_out:
        notice(f"{name}: left out: {sentence}")
    for sentence in found.notes:
        notice(f"{name}: {sentence}")
    remember(found.scene, found.originals)
    return found.scene


def held(scene: Scene, names: Sequence[str]) -> Scene:
    """Return the scene with some bodies fixed to the ground; raises SceneError for an unknown body."""
    known = {body.name: body for body in scene.body}
    if unknown := [name for name in names if name not in known]:
        raise SceneError(
            [f"--hold {n}: no such body; known: {', '.join(known)}{meant(n, known)}" for n in unknown]
        )
    fixed = [Fixed.at(f"hold {n}", (GROUND, n), anchor=known[n].position) for n in names]
    return scene.with_(joint=(*scene.joint, *fixed)) if fixed else scene


def find_certifiable(name: str) -> Scene:
    """Return the scene of a name or file, or the random mechanism with seed N for the name ``random_N``;
    raises RequestError."""
    seed = name.removeprefix("random_")
    if seed == name or not seed.isdecimal():
        return find_scenes([name])[0]
    from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism

    return random_mechanism(int(seed))
