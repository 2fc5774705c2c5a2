"""Refusal of arrays that the memory of this machine does not hold, before they are made."""

from __future__ import annotations

import functools
import math
import os

from mbref.input_error import InputError

LARGEST_SHARE = 0.5  # of the memory; a decomposition needs the matrix twice


def refuse_beyond_memory(size: int, what: str) -> None:
    """Raise InputError if arrays of ``size`` bytes exceed half of the memory of this machine.

    ``what`` is the subject of the sentence. Systems that do not say how much memory they have refuse nothing.
    """
    if size > LARGEST_SHARE * (memory := _memory()):
        raise InputError(f"{what} takes {size / 1e9:.3g} GB, and this machine has {memory / 1e9:.3g} GB")


@functools.cache
def _memory() -> float:
    """Return the memory of this machine in bytes, infinite if the system does not say it."""
    if not hasattr(os, "sysconf"):
        return math.inf
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
