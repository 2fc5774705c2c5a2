"""Support matrix, feature by feature and scene by scene, from every engine's `cannot`.

``python -m crosscheck.cli.support docs/engines.md`` renews the block of a document, without a path it
prints the block.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from crosscheck.conformance.features import feature_scenes, undetermined
from crosscheck.engine import BUILT_IN, LARGE, OPTIONAL, Cannot, engine
from mbref.scene import Scene
from mbref.scenes import SCENES

CAN = "✓"
BEGIN, END = "<!-- support -->", "<!-- /support -->"
KNOWN = (*BUILT_IN, *OPTIONAL, *LARGE)  # the engines of the document's block, installed or not
Ask = Callable[[str, Scene], Cannot | None]  # (engine name, scene)


@dataclass(frozen=True)
class Support:
    """``answers[row][engine]``: None where the engine can, else the reason and who could change it."""

    engines: Sequence[str]
    answers: Mapping[str, Mapping[str, Cannot | None]]

    def __or__(self, other: Support) -> Support:
        """The rows of both, of the same engines."""
        return Support(self.engines, {**self.answers, **other.answers})

    def row(self, name: str, notes: Sequence[str]) -> list[str]:
        """A row's cells: CAN, or the number of its gap's sentence in ``notes``."""
        found = self.answers[name]
        return [CAN if (gap := found[e]) is None else f"– {_number(notes, e, gap)}" for e in self.engines]

    def notes(self) -> list[str]:
        """One sentence for every different gap of an engine, in the order of the rows."""
        gaps = [(e, gap) for found in self.answers.values() for e, gap in found.items() if gap is not None]
        return list(dict.fromkeys(_note(e, gap) for e, gap in gaps))


def of_features(engines: Sequence[str], ask: Ask | None = None) -> Support:
    """Support of every feature, asked on the feature's probe scene; nothing is simulated.

    The engines' packages are not needed.  ``ask`` defaults to the engines' own ``cannot``.
    """
    return _support(engines, {**feature_scenes(), "motion without masses": undetermined()}, ask or _ask)


def of_scenes(engines: Sequence[str], ask: Ask | None = None) -> Support:
    """Support of every built-in scene."""
    return _support(engines, {name: make() for name, make in SCENES.items()}, ask or _ask)


def markdown(engines: Sequence[str]) -> str:
    """The document's block, markers included: features × engines."""
    return "\n".join([BEGIN, *_table("feature", of_features(engines)), END]) + "\n"


def block_of(text: str) -> str:
    """The block between the markers of a document, markers included; ValueError where there is none."""
    start, end = text.find(BEGIN), text.find(END)
    if not 0 <= start < end:
        raise ValueError(f"no {BEGIN} … {END}")
    return text[start : end + len(END)] + "\n"


def _ask(name: str, scene: Scene) -> Cannot | None:
    return engine(name).cannot(scene)


def _support(engines: Sequence[str], scenes: Mapping[str, Scene], ask: Ask) -> Support:
    answers = {name: {e: ask(e, scene) for e in engines} for name, scene in scenes.items()}
    return Support(tuple(engines), answers)


def _table(what: str, support: Support) -> Iterator[str]:
    notes = support.notes()
    yield "| " + " | ".join([what, *support.engines]) + " |"
    yield "|" + "|".join([" --- ", *(" :-: " for _ in support.engines)]) + "|"
    for name in support.answers:
        yield "| " + " | ".join([name, *support.row(name, notes)]) + " |"
    if notes:
        yield ""
        yield from (f"{i}. {note}" for i, note in enumerate(notes, 1))


def _note(name: str, gap: Cannot) -> str:
    return f"{name}: {gap}"


def _number(notes: Sequence[str], name: str, gap: Cannot) -> int:
    return notes.index(_note(name, gap)) + 1


def refresh(path: str | Path) -> None:
    """Replace a document's block by the present one; ValueError where it has none."""
    text = Path(path).read_text()
    Path(path).write_text(text.replace(block_of(text), markdown(KNOWN)))


if __name__ == "__main__":
    if sys.argv[1:]:
        refresh(sys.argv[1])
    else:
        print(markdown(KNOWN), end="")
