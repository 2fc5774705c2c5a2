"""Single precision, noise and numbers that are no evidence in a run; the precision an engine claims."""

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.conformance import suite, trial
from crosscheck.conformance.mechanisms.specimens import specimens
from crosscheck.conformance.runners import InProcess
from crosscheck.judge.precision import grain, not_finite, single_precision
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
    """One array of the judge's exact run is rounded to single precision; of the exact run none is named."""
    single = replace(bench.close, **{name: rounded(getattr(bench.close, name))})
    named = {item.partition(" of ")[0] for item in single_precision(bench.scene, single)}
    assert named == {name.replace("_", " ")}, named
    assert not single_precision(bench.scene, bench.close)


def test_reaction_in_single_precision_is_named_with_its_joint(bench):
    """In the exact run wrenches of joint J are rounded to single precision; nothing else is named."""
    wrenches = bench.close.reactions.items()
    single = replace(bench.close, reactions={n: rounded(w) if n == "J" else w for n, w in wrenches})
    assert single_precision(bench.scene, single) == ["reaction in J"]


def test_quaternions_of_alternating_sign_are_no_noise(bench):
    """q and -q are one orientation. Samples of the judge's exact run alternate between them, and the largest
    noise of positions, orientations and rates stays the rounding of doubles, some 2e-16; signs that count
    would be noise of order 1."""
    signs = np.resize([1.0, -1.0], (len(bench.close.times), 1, 1))
    run = replace(bench.close, orientation=bench.close.orientation * signs)
    noise, _ = grain(bench.scene, run)
    assert noise < 1e-14


def test_constant_simple_and_tiny_numbers_do_not_count_as_single_precision(bench):
    """Such accelerations may have few bits in double precision too. The exact run gets other accelerations: a
    constant 0.1 in single precision, multiples of 1/8, and multiples of 1e-9 in single precision."""
    run = bench.close
    shape = run.acceleration.shape
    steps = np.arange(shape[0])[:, None, None] * np.ones(shape)
    for few in (rounded(0.1 + 0 * steps), steps / 8, rounded((1 + steps) * 1e-9)):
        assert not single_precision(bench.scene, replace(run, acceleration=few)), few[:, 0, 0]


def test_arrays_that_are_not_finite_are_named(bench):
    """Velocities of the exact run become infinite, and the wrenches of joint J NaN."""
    wrench = np.full_like(bench.close.reactions["J"], np.nan)
    lost = replace(bench.close, reactions={"J": wrench}, velocity=np.full_like(bench.close.velocity, np.inf))
    assert not_finite(lost) == ["velocity", "reaction in J"]


def test_engine_that_claims_single_precision_is_not_failed_for_it():
    """Velocities are rounded to single precision. An engine that claims double precision (2⁻⁵²) fails the
    checks of digits and of smoothness; for one that claims single precision (2⁻²³) the check of digits does
    not apply, and the check of smoothness passes."""
    faulty = engine(DEFECTS["velocities rounded to single precision"])
    for claimed, digits, is_failed in ((2.0**-52, suite.FAIL, True), (2.0**-23, suite.OUTSIDE, False)):
        type(faulty).rounding = claimed
        bench = trial.set_up(InProcess(faulty), SPECIMENS["heavy top"])
        assert suite.verdict_on("digits", bench).status == digits
        assert (suite.verdict_on("smooth", bench).status == suite.FAIL) == is_failed
