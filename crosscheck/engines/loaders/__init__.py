"""Readers of robot files: each engine's own parser, and the machine that it builds in one neutral form."""

from __future__ import annotations

import importlib
from collections.abc import Mapping

from crosscheck.engines.loaders.loader import Loader

PLACES: Mapping[str, str] = {  # names of loaders and their classes, in the order of tables
    "mbref": "own:Own",
    "mujoco": "mujoco:Mujoco",
    "mjx": "mjx:Mjx",
    "pinocchio": "pinocchio:Pinocchio",
    "drake": "drake:Drake",
    "dart": "dart:Dart",
    "bullet": "bullet:Bullet",
    "newton": "newton:Newton",
    "yourdfpy": "kinematic:Yourdfpy",
    "urchin": "kinematic:Urchin",
}


def loader(name: str) -> Loader:
    """Return a loader by its name; raises KeyError, or for ``module:attribute`` what its import raises, and
    TypeError for another object than a class of loaders."""
    place = name if ":" in name else f"{__name__}.{PLACES[name]}"
    module, _, attribute = place.partition(":")
    found = getattr(importlib.import_module(module), attribute)
    if isinstance(found, type) and issubclass(found, Loader):
        return found()
    raise TypeError("the object is no class derived from crosscheck.engines.loaders.loader.Loader")
