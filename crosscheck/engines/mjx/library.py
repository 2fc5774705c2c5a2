"""The modules jax and mujoco.mjx, and the folder in which JAX stores compiled code."""

from __future__ import annotations

import contextlib
from importlib import import_module
from typing import Any

from crosscheck.engines.shared import file_cache


def imported(is_single: bool = False) -> Any:
    """Return the modules jax and mujoco.mjx, set to double or single precision on the processor."""
    jax: Any = import_module("jax")
    config = jax.config
    if config.jax_enable_x64 == is_single:  # traces of the other precision fail
        config.update("jax_enable_x64", not is_single)
        jax.clear_caches()
    config.update("jax_platforms", "cpu")
    if not config.jax_compilation_cache_dir:
        with contextlib.suppress(OSError):  # without the folder, no code is stored
            (folder := file_cache.cache("mjx")).mkdir(parents=True, exist_ok=True)
            config.update("jax_compilation_cache_dir", str(folder))
    from mujoco import mjx

    return jax, mjx
