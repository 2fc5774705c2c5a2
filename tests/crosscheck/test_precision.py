"""Digits of a run / single precision, noise, numbers that are no evidence; the precision an engine claims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.conformance import suite, trial
from crosscheck.conformance.runners import InProcess
from crosscheck.conformance.specimens import specimens
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.precision import grain, not_finite, single_precision
from mbref.scene import Body, Scene
from mbref.scenes import SCENES
from tests.zoo.defects import DEFECTS, engine

SPECIMENS = {specimen.scene.name: specimen for specimen in specimens()}
ARRAYS = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")


@pytest.fixture(scope="module")
def bench() -> trial.Bench:
    return trial.set_up(InProcess(engine()), SPECIMENS["revolute joint"])


def rounded(array: np.ndarray) -> np.ndarray:
    return array.astype(np.float32).astype(float)


@pytest.mark.parametrize("name", ARRAYS)
def test_array_in_single_precision_is_named(bench, name):
    single = replace(bench.close, **{name: rounded(getattr(bench.close, name))})
    told = {item.partition(" of ")[0] for item in single_precision(bench.scene, single)}
    assert told == {name.replace("_", " ")}, told
    assert not single_precision(bench.scene, bench.close)


def test_rounded_reactions_and_noise(bench):
    """Reactions of one joint are told by its name; velocities of single precision are noise of 1e-8."""
    run = bench.close
    single = replace(run, reactions={n: rounded(w) if n == "J" else w for n, w in run.reactions.items()})
    assert single_precision(bench.scene, single) == ["reaction in J"]
    noise, of = grain(bench.scene, replace(run, velocity=rounded(run.velocity)))
    assert 1e-9 < noise < 1e-7 and of == "velocities", (noise, of)
    assert grain(bench.scene, run)[0] < 1e-14
    signs = np.resize([1.0, -1.0], (len(run.times), 1, 1))
    assert grain(bench.scene, replace(run, orientation=run.orientation * signs))[0] < 1e-14, "q and -q"


def test_constant_simple_and_tiny_numbers_do_not_count_as_single_precision(bench):
    """Constant, simple and small numbers may be of few bits in double precision too."""
    run = bench.close
    shape = run.acceleration.shape
    steps = np.arange(shape[0])[:, None, None] * np.ones(shape)
    for few in (rounded(0.1 + 0 * steps), steps / 8, rounded((1 + steps) * 1e-9)):
        assert not single_precision(bench.scene, replace(run, acceleration=few)), few[:, 0, 0]


def test_arrays_that_are_not_finite_are_named(bench):
    wrench = np.full_like(bench.close.reactions["J"], np.nan)
    lost = replace(bench.close, reactions={"J": wrench}, velocity=np.full_like(bench.close.velocity, np.inf))
    assert not_finite(lost) == ["velocity", "reaction in J"]


def test_engine_that_claims_single_precision_is_not_failed_for_it():
    """An engine whose velocities are of single precision and which says so / an engine that does not."""
    faulty = engine(DEFECTS["velocities rounded to single precision"])
    for claimed, status in ((2.0**-52, suite.FAIL), (2.0**-23, suite.OUTSIDE)):
        type(faulty).rounding = claimed
        bench = trial.set_up(InProcess(faulty), SPECIMENS["heavy top"])
        assert suite.verdict_on("digits", bench).status == status
        assert (suite.verdict_on("smooth", bench).status == suite.FAIL) == (claimed < 1e-9)


def test_length_of_a_body_in_flight_is_its_way():
    """The characteristic length of a body in flight is its way, at rest its radius of gyration."""
    body = Body(name="body", mass=2.0, inertia=(0.02, 0.08, 0.07), position=(0.3, 0.0, 0.0))
    still = Scene(name="alone", duration=0.5, body=(body,))
    assert scene_length(still) == pytest.approx(0.2)
    assert scene_length(still.with_(gravity=(0.0, -8.0, 0.0))) == pytest.approx(1.0)
    bare = body.model_copy(update={"mass": None, "inertia": None})
    assert scene_length(still.with_(body=(bare,))) == 1.0
    assert scene_length(SCENES["four_bar"]()) == pytest.approx(np.sqrt(0.5))
