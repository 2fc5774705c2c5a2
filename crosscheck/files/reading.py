"""One file in one reader after another: each in a process of its own, compared with the file's meaning."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from crosscheck.engines.loaders import loader
from crosscheck.engines.loaders.loader import Asked, Built, Loader, built
from crosscheck.engines.loaders.machine import Machine
from crosscheck.files.differences import Difference, of_reading
from crosscheck.files.dynamics import NoTruth, State, accelerations_of, closed_poses, end_of, states_of
from crosscheck.files.dynamics_differences import Values, of_rows, of_values
from crosscheck.files.matching import Match, ending, matched
from crosscheck.files.meaning import form_of, meant
from crosscheck.files.merged import size_of
from crosscheck.files.statics import poses
from crosscheck.files.statics_differences import of_statics
from crosscheck.processes.child import Child, ChildFailed

GRAVITY = (0.0, 0.0, -9.81)  # m/s², of gravity torques where the file has no gravity
MOVED = 1e-3  # of the largest displacement; engines that have the file's machine differ by less than 1e-4
UNSETTLED = 0.1  # change by shorter steps / largest displacement, above which a motion is not compared
WITHOUT_MOTION = ("limits", "friction", "gravity", "reference")  # fields on which accelerations do not depend
WITHOUT_STATICS = {  # fields on which neither mass matrix nor gravity torques depend
    *("limits", "friction", "damping", "stiffness", "rest", "reference", "pitch"),
    *("coupling", "law", "loop", "gravity"),
}
CONSTRAINTS = {"coupling", "law", "loop"}  # fields on which rows depend, besides places and axes
ROWS = 1e-6  # rad, between spaces of rows; poses obey loops within 1e-11
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
    """A file with its format, its meaning, and the questions to engines.

    ``states`` have the machine's terms; the motion begins at the last one.
    """

    path: Path
    form: str
    machine: Machine
    asked: Asked
    states: Sequence[State]

    @property
    def size(self) -> float:
        """Return the machine's size, m."""
        return size_of(self.machine)

    def accelerations(self, machine: Machine) -> Values:
        """Return the accelerations of a machine at each state."""
        return [accelerations_of(machine, state) for state in self.states]

    def moved(self, machine: Machine) -> Values:
        """Return the displacements of joints of a machine during the motion from the last state."""
        return (self._moved if machine == self.machine else self._ends(machine))[0]

    @property
    def no_truth(self) -> str:
        """Return why the file's motion is no test of engines; empty if it is one."""
        return self._moved[1]

    @cached_property
    def _moved(self) -> tuple[Values, str]:
        return self._ends(self.machine)

    def _ends(self, machine: Machine) -> tuple[Values, str]:
        """Return displacements for each motion, or none and the reason."""
        try:
            ends = [end_of(machine, start, self.size, self.asked.gravity) for start in self.states[-1:]]
        except NoTruth as reason:
            return [], str(reason)
        return [since(start.pose, end) for start, end in zip(self.states[-1:], ends, strict=True)], ""


def since(start: Mapping[str, float], end: Mapping[str, float]) -> dict[str, float]:
    """Return displacements from the start of a motion; names may begin with a model's."""
    return {name: value - start.get(ending(name), 0.0) for name, value in end.items()}


@dataclass(frozen=True)
class Reading:
    """A reader's result: version, machine and differences, or the reason of a refusal.

    ``messages`` are lines that the reader printed, and ``unknown`` is why a quantity is not compared.
    ``seconds`` is the CPU time of reader and comparison. ``convention`` is a choice that the format leaves
    open, in a sentence.
    """

    reader: str
    version: str
    machine: Machine | None
    differences: tuple[Difference, ...]
    refusal: str
    messages: tuple[str, ...]
    seconds: float = 0.0
    unknown: Mapping[str, str] = field(default_factory=dict)
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
    size, gravity = size_of(machine), machine.gravity or GRAVITY
    random = poses(machine, size)
    states = states_of(machine, random, size, gravity)
    pairs = [(state.pose, state.rates) for state in states]
    asked = Asked(random, closed_poses(machine, random, size), pairs, pairs[-1:], gravity)
    return File(path, form, machine, asked, states)


def read(reader: Reader, file: File, time_limit: float) -> Reading:
    """Return the reading of a file in a process of its own, within CPU time (s)."""
    with closing(Child(reader.python)) as child:
        return read_in(child, reader, file, time_limit)


def read_in(child: Child, reader: Reader, file: File, time_limit: float) -> Reading:
    """Return the reading of a file in a child process, which has ended if the file is refused."""
    began, of_reader = time.process_time(), loader(reader.name)
    asked = reader.name, file.path.resolve(), file.form, file.asked
    try:
        seen = child.call(_built, asked, time_limit)
    except ChildFailed as failure:
        version = of_reader.installed() if reader.python is None else of_reader.version
        said = " ".join(COLOURS.sub("", str(failure)).split())
        reason = re.sub(r"^(?:[\w.]*\bSceneError: |(?:\w+\.)+(?=\w+: ))", "", said)
        return Reading(of_reader.name, version, None, (), reason, (), time.process_time() - began)
    found, seconds = seen.value
    reading = _compared(of_reader, file, found, seen.printed)
    return replace(reading, seconds=seconds + time.process_time() - began)


def _built(name: str, path: Path, form: str, asked: Asked) -> tuple[Built, float]:
    """Return what a loader built, and its CPU time (s); called in the child."""
    began = time.process_time()
    return built(loader(name), path, form, asked), time.process_time() - began


def _compared(of_reader: Loader, file: File, found: Built, printed: str) -> Reading:
    match = matched(file.machine, found.machine, of_reader.tolerance)
    lines = [line.strip() for line in COLOURS.sub("", printed).splitlines() if line.strip()]
    messages = (*found.machine.messages, *lines)
    differing = differences(match, file, found, of_reader.tolerance)
    return Reading(
        of_reader.name,
        found.version,
        replace(found.machine, messages=messages),
        tuple(differing),
        refusal="",
        messages=messages,
        unknown={**found.faults, **_no_motion(file, found, differing)},
        convention=of_reader.convention,
    )


def differences(match: Match, file: File, found: Built, tolerance: float) -> list[Difference]:
    """Return the differences of what was read, and of the engine's answers that do not follow from these."""
    reading, asked = of_reading(match, tolerance), file.asked
    read = {difference.field for difference in reading}
    if read <= WITHOUT_STATICS:
        reading += of_statics(match, found.statics, asked.poses, asked.gravity, tolerance)
    if read <= WITHOUT_STATICS - CONSTRAINTS:
        reading += of_rows(match, found.rows, asked.closed, max(tolerance, ROWS))
    if all(difference.field in WITHOUT_MOTION for difference in reading):
        reading += of_values(match, found.accelerations, file.accelerations, "acceleration", tolerance)
    if all(difference.field in WITHOUT_MOTION for difference in reading):
        ends, change = displacements(file, found), _change(file, found)
        if change <= UNSETTLED:
            own = [short for short, _ in ends]
            reading += of_values(match, own, file.moved, "displacement", MOVED + change)
    return reading


def displacements(file: File, found: Built) -> list[tuple[Mapping[str, float], Mapping[str, float]]]:
    """Return an engine's displacements since each start, by its shortest steps and by longer ones."""
    starts = zip(file.asked.starts, found.ends, strict=False)
    return [(since(pose, short), since(pose, long)) for (pose, _), (short, long) in starts]


def _change(file: File, found: Built) -> float:
    """Return the largest change of displacements from longer to shorter steps / the largest displacement.
    Numbers that are not finite are wrong, however short the steps: they count as unchanged."""
    pairs = [[short[name], long[name]] for short, long in displacements(file, found) for name in short]
    values = np.array(pairs).reshape(-1, 2)
    if not np.isfinite(values).all():
        return 0.0
    largest = np.abs(values).max(initial=0.0)
    return float(np.ptp(values, axis=1).max(initial=0.0) / (largest or 1.0))


def _no_motion(file: File, found: Built, differing: Sequence[Difference]) -> dict[str, str]:
    """Return why the motion is not compared, although what was read and the accelerations agree."""
    if not found.ends or any(difference.field not in WITHOUT_MOTION for difference in differing):
        return {}
    if (change := _change(file, found)) > UNSETTLED:
        return {"motion": f"steps of half the length change its end by {100 * change:.0f} %"}
    return {"motion": file.no_truth} if file.no_truth else {}


def readings(file: File, readers: Sequence[Reader], time_limit: float, say: Say, done: Say) -> list[Reading]:
    """Return the readings of all readers; ``say`` receives the running work, ``done`` each finished one."""
    found = []
    for reader in readers:
        say(f"{reader.name} reads {file.path.name}")
        found.append(read(reader, file, time_limit))
        done(f"{reader.name}: {found[-1].grade}")
    return found
