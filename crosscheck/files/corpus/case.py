"""A small file with one feature of its format, and the machine that the specification gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from crosscheck.engines.loaders.loader import MJCF, SDF, URDF
from crosscheck.engines.loaders.machine import Machine

ENDINGS = {MJCF: ".xml", URDF: ".urdf", SDF: ".sdf"}


@dataclass(frozen=True)
class Case:
    """A feature with the text of its file; ``right`` has values by paths such as ``joint shoulder axis``.

    ``section`` is the part of the specification, and ``why`` its statement in our words.
    """

    name: str
    form: str
    text: str
    right: Mapping[str, Any]
    section: str
    why: str

    @property
    def file(self) -> str:
        """Return the name of the file."""
        return f"{self.name.replace(' ', '_')}{ENDINGS[self.form]}"


def value_at(machine: Machine, path: str) -> Any:
    """Return a value of a machine: ``gravity``, ``joints`` (number that move), or ``kind name field``.

    Raises KeyError if the machine has no such part.
    """
    if path == "gravity":
        return machine.gravity
    if path == "joints":
        return sum(joint.type != "fixed" for joint in machine.joints)
    kind, name, field = path.split()
    parts: Mapping[str, Any] = {
        "body": machine.bodies,
        "joint": machine.joints,
        "loop": machine.loops,
        "coupling": machine.couplings,
    }
    names = {part.follower if kind == "coupling" else part.name: part for part in parts[kind]}
    return getattr(names[name], field)
