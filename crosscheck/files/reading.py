"""One file in one reader after another: each in a process of its own, compared with the file's meaning."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from crosscheck.engines.loaders import loader
from crosscheck.engines.loaders.loader import Built, Loader, built
from crosscheck.engines.loaders.machine import Machine, Vector
from crosscheck.files.differences import Difference, of_reading
from crosscheck.files.dynamics import State, of_dynamics, states_of
from crosscheck.files.matching import matched
from crosscheck.files.meaning import form_of, meant
from crosscheck.files.merged import size_of
from crosscheck.files.statics import Pose, poses
from crosscheck.files.statics_differences import of_statics
from crosscheck.processes.child import Child, ChildFailed

GRAVITY = (0.0, 0.0, -9.81)  # m/s², of gravity torques where the file has no gravity
WITHOUT_MOTION = ("limits", "friction", "gravity", "reference")  # fields on which accelerations do not depend
WITHOUT_STATICS = {  # fields on which neither mass matrix nor gravity torques depend
    *("limits", "friction", "damping", "stiffness", "rest", "reference", "pitch"),
    *("coupling", "law", "loop", "gravity"),
}
COLOURS = re.compile(r"(?:\x1b|\\x1b)\[[0-9;]*m")  # escape sequences of terminals
Say = Callable[[str], None]

SAME, ALMOST, ANOTHER, REFUSED = "the same machine", "the same except for", "another machine", "cannot read"


@dataclass(frozen=True)
class Reader:
    """A loader by its name, with the interpreter of another environment, or None for this one."""

    name: str
    python: Path | None = None


@dataclass(frozen=True)
class File:
    """A file with its format, its meaning, and the poses, states and gravity at which engines are asked.

    ``states`` are empty unless the machine is a tree of hinges and slides.
    """

    path: Path
    form: str
    machine: Machine
    poses: Sequence[Pose]
    states: Sequence[State]
    gravity: Vector


@dataclass(frozen=True)
class Reading:
    """A reader's result: version, machine and differences, or the reason of a refusal.

    ``messages`` are lines that the reader printed, and ``unknown`` is why its statics are not compared.
    ``convention`` is a choice that the format leaves open, in a sentence.
    """

    reader: str
    version: str
    machine: Machine | None
    differences: tuple[Difference, ...]
    refusal: str
    messages: tuple[str, ...]
    unknown: str
    seconds: float
    convention: str = ""

    @property
    def grade(self) -> str:
        """Return SAME, ALMOST, ANOTHER or REFUSED."""
        if self.refusal:
            return REFUSED
        if not self.differences:
            return SAME
        return ALMOST if all(found.is_minor for found in self.differences) else ANOTHER


def file_of(path: Path) -> File:
    """Return a file with its meaning; raises SceneError for a faulty file, OSError."""
    form = form_of(path)
    machine = meant(path, form)
    size = size_of(machine)
    asked = poses(machine, size)
    gravity = machine.gravity or GRAVITY
    return File(path, form, machine, asked, states_of(machine, asked, size, gravity), gravity)


def read(reader: Reader, file: File, time_limit: float) -> Reading:
    """Return the reading of a file in a process of its own, within CPU time (s)."""
    with closing(Child(reader.python)) as child:
        return read_in(child, reader, file, time_limit)


def read_in(child: Child, reader: Reader, file: File, time_limit: float) -> Reading:
    """Return the reading of a file in a child process, which has ended if the file is refused."""
    began, of_reader = time.monotonic(), loader(reader.name)
    rates = [state.rates for state in file.states]
    asked = reader.name, file.path.resolve(), file.form, file.poses, rates, file.gravity
    try:
        seen = child.call(_built, asked, time_limit)
    except ChildFailed as failure:
        version = of_reader.installed() if reader.python is None else of_reader.version
        said = " ".join(COLOURS.sub("", str(failure)).split())
        reason = re.sub(r"^(?:[\w.]*\bSceneError: |(?:\w+\.)+(?=\w+: ))", "", said)
        return Reading(of_reader.name, version, None, (), reason, (), "", time.monotonic() - began)
    return _compared(of_reader, file, seen.value, seen.printed, time.monotonic() - began)


def _built(
    name: str, path: Path, form: str, asked: Sequence[Pose], rates: Sequence[Pose], gravity: Vector
) -> Built:
    """Return what a loader built; called in the child."""
    return built(loader(name), path, form, asked, rates, gravity)


def _compared(of_reader: Loader, file: File, found: Built, printed: str, seconds: float) -> Reading:
    match, tolerance = matched(file.machine, found.machine, of_reader.tolerance), of_reader.tolerance
    reading = of_reading(match, tolerance)
    statics = of_statics(match, found.statics, file.poses, file.gravity, tolerance)
    explained = [difference for difference in reading if difference.field not in WITHOUT_STATICS]
    lines = [line.strip() for line in COLOURS.sub("", printed).splitlines() if line.strip()]
    messages = (*found.machine.messages, *lines)
    differences = [*reading, *([] if explained else statics)]  # numbers of statics follow from these
    if all(difference.field in WITHOUT_MOTION for difference in differences):
        differences += of_dynamics(match, found.accelerations, file.states, tolerance)
    machine = replace(found.machine, messages=messages)
    return Reading(
        of_reader.name,
        found.version,
        machine,
        tuple(differences),
        refusal="",
        messages=messages,
        unknown=found.fault,
        seconds=seconds,
        convention=of_reader.convention,
    )


def readings(file: File, readers: Sequence[Reader], time_limit: float, say: Say, done: Say) -> list[Reading]:
    """Return the readings of all readers; ``say`` receives the running work, ``done`` each finished one."""
    found = []
    for reader in readers:
        say(f"{reader.name} reads {file.path.name}")
        found.append(read(reader, file, time_limit))
        done(f"{reader.name}: {found[-1].grade}")
    return found
