"""Known violations of cards with cause and remedy, and the defects that prove the cards, read from data."""

from __future__ import annotations

import functools
import tomllib
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent


class Explanation(NamedTuple):
    """The cause of an engine's violation of a card and its remedy; a sentence each."""

    cause: str
    remedy: str


class Proof(NamedTuple):
    """A planted defect, and the scene and the card that tell it."""

    about: str
    scene: str
    card: str


@functools.cache
def explanations() -> dict[tuple[str, str, str], Explanation]:
    """By engine, card without its version, and scene."""
    found = tomllib.loads((FOLDER / "explained.toml").read_text()).get("violation", ())
    return {
        (entry["engine"], card, scene): Explanation(entry["cause"], entry["remedy"])
        for entry in found
        for card in entry["cards"]
        for scene in entry["scenes"]
    }


@functools.cache
def proofs() -> tuple[Proof, ...]:
    """Every defect of the zoo."""
    found = tomllib.loads((FOLDER / "proved_by.toml").read_text())["defect"]
    return tuple(Proof(**entry) for entry in found)
