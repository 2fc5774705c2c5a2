"""Sweeps: one scene by one method with several values of its options, such as the gains of Baumgarte."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mbref.input_error import InputError
from mbref.method import Method
from mbref.motions.motion import Motion
from mbref.printable import exact
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.simulate import Limits, simulate

MOST_RUNS = 100  # of one sweep


def sweep(
    scene: Scene | str | Path,
    method: Method | str,
    options: Mapping[str, Sequence[float]],
    times: Sequence[float] | np.ndarray | None = None,
    limits: Limits | None = None,
) -> dict[str, Motion]:
    """Return the motions of a scene by a method with all combinations of values of its options.

    ``mbref.plot(mbref.sweep(…), "position_violation")`` draws them into one figure.

    Parameters
    ----------
    scene : Scene, str or path
        A Scene, the name of a built-in one, or a .toml file.
    method : Method or str
        A method or its name.
    options : mapping of str to sequence of float
        Values by option, such as ``{"alpha": [1, 5, 25]}``, in the units of ``mbref list methods``. If two
        parts of the method have the option, its name is ``"baumgarte.alpha"``.
    times : sequence of float or ndarray, shape (k,), optional
        Sample times, s, as of ``simulate``.
    limits : Limits, optional
        Limits of each run.

    Returns
    -------
    dict of str to Motion
        Motions by label, such as ``"alpha = 5, beta = 1"``. A run that ends early has its outcome.

    Raises
    ------
    MethodError
        If the method has no such option, or a value is negative.
    InputError
        If there are no values, more than 100 combinations, or two names of one option.
    """
    scene = find_scene(scene)
    methods = methods_of(method, options)
    return {label: simulate(scene, each, times, limits) for label, each in methods.items()}


def methods_of(method: Method | str, options: Mapping[str, Sequence[float]]) -> dict[str, Method]:
    """Return the methods of a sweep by label; raises the errors of ``sweep``."""
    base = Method.parse(method) if isinstance(method, str) else method
    if not options or not all(len(values) for values in options.values()):
        raise InputError("options: each needs one value at least")
    count = int(np.prod([len(values) for values in options.values()]))
    if count > MOST_RUNS:
        raise InputError(f"options: {count} combinations; a sweep has at most {MOST_RUNS}")
    owned: dict[tuple[str, str], str] = {}
    for name in options:
        if (first := owned.setdefault(base.option_named(name), name)) != name:
            raise InputError(f"options: {first!r} and {name!r} are one option; give it once")
    found = {}
    for values in itertools.product(*options.values()):
        changed = base
        for name, value in zip(options, values, strict=True):
            changed = changed.with_option(name, value)
        found[", ".join(f"{n} = {exact(v)}" for n, v in zip(options, values, strict=True))] = changed
    return found
