"""The cases of the fuzzers, each by its seed; anything that is not documented is raised. ``scene_file``:
reading, writing, diagnosing. ``simulation``: a scene by a method within limits. ``command_line``: every
command of all programs. A case that takes long is interrupted, which it has to hear."""

import contextlib
import json
import random
import signal
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path

from mbref.design.diagnosis import diagnose
from mbref.method import Method, MethodError
from mbref.records import strict_json
from mbref.scene import Scene, SceneError
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, prepare, simulate
from tests.fuzz import mutations
from tests.fuzz.command_lines import command_line, commands, refuse_constant

LONG = 10.0  # s after which a case is interrupted
PATIENCE = {"command_line": 3.0}  # s; measuring commands would take hours


def scene_file(seed: int) -> str:
    """Read a mutated file; write what was read and read that; diagnose it."""
    draw = random.Random(seed)
    Path("scene.toml").write_bytes(mutations.mutated_text(draw))
    try:
        scene = Scene.from_file("scene.toml")
    except SceneError as error:
        assert error.faults and all(error.faults), "an error without a fault"
        return "refused"
    scene.save("again.toml")
    assert Scene.from_file("again.toml") == scene, "another scene comes out of the file that it was saved to"
    try:
        diagnose(scene)
    except SceneError:
        return "read, not diagnosed"
    return "diagnosed"


def scene_data(seed: int) -> str:
    """A scene from Python's objects."""
    try:
        Scene(**mutations.mutated_data(random.Random(seed)))
    except SceneError:
        return "refused"
    return "accepted"


def simulation(seed: int) -> str:
    """A run; the record of what it reached is strict JSON."""
    draw = random.Random(seed)
    try:
        scene = _accepted(draw)
        limits = Limits(**mutations.limits(draw))
        run = simulate(scene, mutations.method(draw), mutations.times(draw), limits)
    except (SceneError, MethodError, ValueError) as error:
        assert str(error), "an error without a message"
        return type(error).__name__
    json.loads(strict_json(run.to_record()), parse_constant=refuse_constant)
    return run.outcome.name


def _accepted(draw: random.Random) -> Scene:
    """A mutated scene that is a scene."""
    while True:
        with contextlib.suppress(SceneError):
            return Scene(**mutations.mutated_data(draw))


TARGETS = {f.__name__: f for f in (scene_file, scene_data, simulation, command_line)}


def compile_all() -> None:
    """Compile and import what the cases need, so that none is interrupted in that."""
    commands()
    for name in dict.fromkeys(mutations.METHODS):
        prepare(Method.parse(name))
    diagnose(SCENES["four_bar"]())


def case(name: str, seed: int) -> tuple[str, str]:
    """How the case of that seed ended, and what was wrong with that, or ""."""
    try:
        with warnings.catch_warnings(), _interrupted_after(PATIENCE.get(name, LONG)):
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", ResourceWarning)  # of an interrupt while a file is opened
            return TARGETS[name](seed), ""
    except KeyboardInterrupt:
        return "interrupted", ""
    except BaseException as error:
        sentence = traceback.format_exception_only(error)[-1].strip()[:300]
        return "DEFECT", f"{sentence} | {_where(error)}"


def _where(error: BaseException) -> str:
    """The last lines of the packages that the error came through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if any(package in f.filename for package in ("mbref", "crosscheck"))]
    return " ".join(f"{Path(f.filename).name}:{f.lineno}" for f in ours[-3:])


@contextlib.contextmanager
def _interrupted_after(seconds: float) -> Iterator[None]:
    """SIGINT, as from Ctrl-C, unless the block ends before."""
    before = signal.signal(signal.SIGALRM, _interrupt)
    ignored = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background ignores SIGINT
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        signal.signal(signal.SIGINT, ignored)


def _interrupt(*_: object) -> None:
    signal.raise_signal(signal.SIGINT)  # a command may pass it on to a program that it runs
