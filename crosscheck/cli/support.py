"""Support matrix: which features and scenes each engine can simulate, from the engines' method `cannot`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from crosscheck.conformance.mechanisms.closed_forms import armature_pendulum, gear_pair, rack, screw
from crosscheck.conformance.mechanisms.coupled import coupled_probes, driven_ball, event_probes, wheel
from crosscheck.conformance.mechanisms.features import feature_scenes, massless_link, undetermined
from crosscheck.engine import BUILT_IN, LARGE, OPTIONAL, Cannot, engine
from mbref.scene import Scene
from mbref.scenes import SCENES

CAN = "✓"
KNOWN = (*BUILT_IN, *OPTIONAL, *LARGE)  # engines in the support table, installed or not
Ask = Callable[[str, Scene], Cannot | None]  # function of (engine name, scene) that returns a refusal or None


@dataclass(frozen=True)
class Support:
    """Support matrix: ``answers[row][engine]`` is None if the engine can simulate the row, otherwise its
    refusal."""

    engines: Sequence[str]
    answers: Mapping[str, Mapping[str, Cannot | None]]

    def __or__(self, other: Support) -> Support:
        """Return a matrix with the rows of both matrices, which have the same engines."""
        return Support(self.engines, {**self.answers, **other.answers})

    def row(self, name: str, notes: Sequence[str]) -> list[str]:
        """Return the cells of a row: CAN, or the number that the reason of the refusal has in ``notes``."""
        found = self.answers[name]
        return [CAN if (gap := found[e]) is None else f"– {_number(notes, gap)}" for e in self.engines]

    def notes(self) -> list[str]:
        """Return one sentence for each different refusal with the engines that refuse, in the order of the
        rows."""
        refusing: dict[str, list[str]] = {}
        for found in self.answers.values():
            for name, gap in found.items():
                if gap is not None and name not in (names := refusing.setdefault(str(gap), [])):
                    names.append(name)
        return [f"{', '.join(names)}: {refusal}" for refusal, names in refusing.items()]


def of_features(engines: Sequence[str], ask: Ask | None = None) -> Support:
    """Return the support of every feature: each engine's ``cannot`` is called with a probe scene of the
    feature.

    Nothing is simulated, and the engines' packages are not needed. ``ask`` replaces the engines' ``cannot``.
    """
    further = {
        "coupling of angles": gear_pair()[0],
        "coupling of an angle and a displacement": rack()[0],
        "coupling within a joint": screw()[0],
        "coupling of three coordinates": coupled_probes()["sum of coordinates"],
        "polynomial coupling": coupled_probes()["cam in motion"],
        "armature": armature_pendulum()[0],
        **event_probes(),
        "driven orientation": driven_ball(),
        "wheel": wheel(),
        "massless link": massless_link(),
        "motion without masses": undetermined(),
    }
    return _support(engines, {**feature_scenes(), **further}, ask or _ask)


def of_scenes(engines: Sequence[str], ask: Ask | None = None) -> Support:
    """Return the support of every built-in scene."""
    return _support(engines, {name: make() for name, make in SCENES.items()}, ask or _ask)


def _ask(name: str, scene: Scene) -> Cannot | None:
    return engine(name).cannot(scene)


def _support(engines: Sequence[str], scenes: Mapping[str, Scene], ask: Ask) -> Support:
    answers = {name: {e: ask(e, scene) for e in engines} for name, scene in scenes.items()}
    return Support(tuple(engines), answers)


def _number(notes: Sequence[str], gap: Cannot) -> int:
    return next(i for i, note in enumerate(notes, 1) if note.split(": ", 1)[1] == str(gap))
