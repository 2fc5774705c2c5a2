"""Readers of files with planted faults: one drops couplings and friction, one refuses a nameless model."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from crosscheck.engines.loaders.loader import MJCF, URDF, Loaded, Loader
from crosscheck.engines.loaders.machine import Machine, Statics, Vector
from crosscheck.files.meaning import meant
from crosscheck.files.statics import statics_of


class Followed(Loaded):
    """A machine with its statics."""

    def __init__(self, machine: Machine):
        self.own = machine

    def machine(self) -> Machine:
        """Return the machine."""
        return self.own

    def statics(self, pose: Mapping[str, float], gravity: Vector) -> Statics:
        """Return the statics of the machine."""
        return statics_of(self.own, pose, gravity)


class Uncoupled(Loader):
    """A reader that drops couplings, says so, and does not say that it drops friction."""

    name, package, version, formats = "uncoupled", "mbref", "", (MJCF, URDF)

    def load(self, path: Path, form: str) -> Loaded:
        """Read the file without couplings and friction."""
        machine = meant(path, form)
        print("mimic of joint 'wrist' is not supported")
        joints = tuple(replace(joint, friction=0.0) for joint in machine.joints)
        return Followed(replace(machine, couplings=(), joints=joints))


class Strict(Loader):
    """A reader that refuses a model without a name."""

    name, package, version, formats = "strict", "mbref", "", (MJCF,)

    def load(self, path: Path, form: str) -> Loaded:
        """Read a file with the name of a model."""
        if not ET.parse(path).getroot().get("model"):
            raise ValueError("the model has no name")
        return Followed(meant(path, form))
