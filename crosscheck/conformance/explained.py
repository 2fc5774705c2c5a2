"""Known violations of checks with cause and remedy, and planted defects that the checks detect, read from
data files."""

from __future__ import annotations

import functools
import tomllib
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent


class Explanation(NamedTuple):
    """Cause and remedy of an engine's violation of a check, one sentence each."""

    cause: str
    remedy: str


class Proof(NamedTuple):
    """A planted defect, with the scene and the check that detect it."""

    about: str
    scene: str
    check: str


@functools.cache
def explanations() -> dict[tuple[str, str, str], Explanation]:
    """Return the explanations by (engine, check without its version, scene)."""
    found = tomllib.loads((FOLDER / "explained.toml").read_text()).get("violation", ())
    return {
        (entry["engine"], check, scene): Explanation(entry["cause"], entry["remedy"])
        for entry in found
        for check in entry["checks"]
        for scene in entry["scenes"]
    }


@functools.cache
def proofs() -> tuple[Proof, ...]:
    """Return all planted defects."""
    found = tomllib.loads((FOLDER / "proved_by.toml").read_text())["defect"]
    return tuple(Proof(**entry) for entry in found)
