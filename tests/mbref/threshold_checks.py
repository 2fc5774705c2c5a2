"""Registry of the checks of thresholds outside ``mbref.taylor.crossing``, and helpers of all such checks.

A key is a module of mbref and a constant.  Each check has its numbers written out: a threshold that moves by
10 % (a count: by one) fails its check.
"""

import contextlib
import math
from types import SimpleNamespace

import numpy as np
import pytest

from mbref.taylor.mode import HIGH_ACCURACY

CHECKS = {}
# kernels that other kernels call by address, for tests to replace
KERNELS = SimpleNamespace(determinant=None, gradient=None)


def check(key):
    """Decorate the check of a threshold, by module and name."""

    def put(function):
        assert key not in CHECKS, key
        CHECKS[key] = function
        return function

    return put


def near(value, expected):
    """Whether a number is equal to another to a thousandth."""
    return bool(value == pytest.approx(expected, rel=1e-3, abs=0.0))


def flips(decision, below, above):
    """Whether a decision is True at one number and False at another."""
    return bool(decision(below)) and not decision(above)


def first_arguments(monkeypatch, module, name, call):
    """The arguments with which ``call()`` first calls a function of a module; the call ends there."""
    given = []

    def noted(*arguments):
        given.append(arguments)
        raise InterruptedError

    monkeypatch.setattr(module, name, noted)
    with contextlib.suppress(InterruptedError):
        call()
    return given[0]


def memory(variables=2, rank=1, kind=HIGH_ACCURACY, **numbers):
    """A memory of a step at whose start the least pivot is 1, and at whose end it is ``pivot``."""
    step = {
        "start_partition_id": 1,
        "start_parity": 0,
        "start_pivot": 1.0,
        "start_negative": 0,
        "start_logarithm": 0.0,
        "start_violation": 0.0,
        "approaching": 1,
        "last_order": 22,
        "used_order": 22,
        "time_to_pole": 0.0,
        "time_to_crossing": 0.0,
        "deceleration": 0.0,
        "violation": 0.0,
        "correction": 0.0,
        "crossed": 0,
        "first_crossing": 0.0,
        "second_crossing": -1.0,
    }
    progress = {
        "largest_pivot": 1.0,
        "entry_pivot": 1.0,
        "leaving": 0,
        "rests_near": 1,
        "end": 1.0,
        "clearance": 0.0,
        "is_clear": 0,
    }
    for name in set(numbers) & set(step):
        step[name] = numbers[name]
    for name in set(numbers) & set(progress):
        progress[name] = numbers[name]
    pivots = np.full(rank, numbers.get("pivot", 1.0))
    solver = SimpleNamespace(
        pivot_columns=np.arange(variables),
        pivot_rows=np.arange(rank),
        last=pivots,
        past=np.ones(rank),
        null_space=np.eye(variables),
        past_motion=np.eye(variables)[0],
    )
    speed = numbers.get("speed", 1.0)
    terms = np.zeros((31, 8))
    terms[1, 0] = speed
    clock = SimpleNamespace(time=numbers.get("time", 0.0), length=1.0, attempt_end=0.0)
    counts = SimpleNamespace(steps=1, crossings=0, rejected=0)
    control = SimpleNamespace(largest_step=1e3, first_step=0.0, smallest_step=1e-12, most_steps=10**6)
    return SimpleNamespace(
        step=SimpleNamespace(**step),
        progress=SimpleNamespace(**progress),
        partition=SimpleNamespace(rank=rank, partition_id=1, parity=0, replaced_pivot=-math.inf),
        mode=SimpleNamespace(kind=kind, tolerance=numbers.get("tolerance", 1e-14), order=22),
        options=SimpleNamespace(
            velocity_change=numbers.get("velocity_change", 1e-6),
            accurate_tolerance=1e-14,
            accurate_order=22,
            start_freedoms=variables - rank,
            start_distance=1.0,
        ),
        solver=solver,
        series=SimpleNamespace(
            past=terms.copy(), terms=terms, variable=np.ones(8), past_angles=np.zeros((0, 31))
        ),
        polynomials=SimpleNamespace(
            given=SimpleNamespace(driver=np.zeros(numbers.get("drivers", 0))),
            springs=SimpleNamespace(stiffness=np.zeros(0)),
            inertia=SimpleNamespace(mass=np.eye(variables)),
        ),
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=clock),
            equations=SimpleNamespace(
                system=SimpleNamespace(counts=counts, settings=SimpleNamespace(nearly_dependent=True)),
                piece=np.zeros(0),
            ),
            control=control,
            state=SimpleNamespace(velocities=np.array([numbers.get("velocity", 1.0)])),
        ),
        state=np.zeros((3, 8)),
        kernels=KERNELS,
    )
