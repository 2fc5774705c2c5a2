"""Less overhead of numba's compiler, which otherwise takes a tenth of a compilation."""

from __future__ import annotations

import contextlib
import functools
import gc
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

from numba.core.targetconfig import TargetConfig


@contextlib.contextmanager
def garbage_kept() -> Iterator[None]:
    """Search for no garbage in the ``with`` block: nearly all objects of a compilation live until its end."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def compare_options_as_dictionaries() -> None:
    """Let numba read its options in one step.

    numba compares its 40 options whenever it resolves a call, and reads each of them by a property.
    """
    TargetConfig.values = _values  # type: ignore[method-assign]


def _values(options: TargetConfig) -> dict[str, Any]:
    """Return all options by name."""
    return {**_defaults(type(options)), **options._values}


@functools.cache
def _defaults(kind: type[TargetConfig]) -> Mapping[str, Any]:
    """Return the default of every option of a kind of options."""
    return MappingProxyType({name: option.default for name, option in kind.options.items()})
