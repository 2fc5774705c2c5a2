"""Equilibria of random mechanisms, against accelerations and eigenvalues of the judge's own equations."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from crosscheck.conformance.changes.units import in_other_units, scaled
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.small_motions.equations import Balance
from crosscheck.judge.small_motions.error_bounds import error_bounds
from mbref import Scene, equilibria, find_scene
from tests.helpers.powered_mechanisms import powered_mechanism
from tests.helpers.statics import parallelogram, pendulum

STEP = 0.003  # of the judge's differences: their errors are about 1e-14
BALANCED = 1e-9  # acceleration at an equilibrium / acceleration at the start
ROUNDED = 1e-13  # error of eigenvalues in doubles / largest one


def at_rest(scene: Scene) -> Scene:
    """Return the scene at rest, without drivers and without loads over time."""
    still = {"velocity": None, "angular_velocity": None}
    body, load = [each.model_copy(update=still) for each in scene.body], scene.load
    return scene.with_(body=body, driver=(), load=[each for each in load if each.over_time is None])


class Judged(NamedTuple):
    """Errors of an equilibrium by the judge's own equations."""

    acceleration: float  # over the acceleration at the start of the search
    eigenvalues: float  # largest error / its bound and rounding; 0 at a singular position, which has none


def judged(scene: Scene, starts: int) -> list[Judged]:
    """Return the errors of all equilibria that are found for a scene."""
    found, size = [], np.abs(gauss(scene)).max()
    for each in equilibria(scene, starts=starts):
        acceleration = np.abs(gauss(each.scene)).max() / size
        if each.is_singular:
            found.append(Judged(acceleration, 0.0))
            continue
        balance = Balance(each.scene)
        state = balance.start()
        small, coarse = balance.small(state, STEP), balance.small(state, 2 * STEP)
        exact = small.eigenvalues()
        assert len(exact) == len(each.eigenvalues)
        gaps = np.abs(exact[:, None] - each.eigenvalues[None])
        pairs = linear_sum_assignment(gaps)
        allowed = each.bounds[pairs[1]] + error_bounds(small, [coarse]) + ROUNDED * np.abs(exact).max()
        found.append(Judged(acceleration, (gaps[pairs] / allowed).max()))
    return found


@pytest.mark.parametrize("seed", [0, 3])
def test_eigenvalues_agree_with_the_judges_within_their_bounds(seed):
    """The judge linearises its own equations at a pose where its own accelerations vanish."""
    (found,) = judged(at_rest(random_mechanism(seed)), starts=1)
    assert found.acceleration < BALANCED and found.eigenvalues <= 1


def test_eigenvalues_of_two_equilibria_of_a_leg_of_seven_links_are_the_judges():
    """The leg's 50 constraint rows, 9 of them redundant, are solved by sparse factorisations. Differences
    from the judge's eigenvalues are at most the stated bounds; accelerations vanish."""
    first, second = judged(find_scene("strandbeest[1]"), starts=16)
    assert max(first.acceleration, second.acceleration) < BALANCED
    assert max(first.eigenvalues, second.eigenvalues) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("first", range(5, 215, 10))
def test_eigenvalues_of_many_mechanisms_agree_with_the_judges_within_their_bounds(first):
    """At least one of ten mechanisms has an equilibrium. Each difference is at most its bound. Mechanisms of
    odd seeds have springs of many turns, and couplings of two to four coordinates."""
    scenes = [(random_mechanism, powered_mechanism)[seed % 2](seed) for seed in range(first, first + 10)]
    found = [each for scene in scenes for each in judged(at_rest(scene), starts=3)]
    assert found and max(each.acceleration for each in found) < BALANCED
    assert max(each.eigenvalues for each in found) <= 1


SPRING = {"type": "torsion_spring", "joint": "A", "stiffness": 30.0, "damping": 0.5}


@pytest.mark.parametrize(("length", "mass", "time"), [(1e-6, 1.0, 1.0), (1e3, 1e-9, 1e-3), (1e6, 1e9, 1e3)])
@pytest.mark.parametrize(
    "scene", [parallelogram(sine=0.6, cosine=0.8), pendulum(load=[SPRING])], ids=["linkage", "sprung"]
)
def test_equilibria_in_other_units_have_proportional_places_and_eigenvalues(scene, length, mass, time):
    """``length``, ``mass`` and ``time`` are factors of the numbers. Eigenvalues (1/s) times the factor of
    time agree within the bounds of both, places divided by the factor of length to 1e-9 m."""
    found, others = equilibria(scene, 3), equilibria(in_other_units(scaled(scene, mass), length, time), 3)
    assert found
    for each, other in zip(found, others, strict=True):
        assert each.stability == other.stability
        allowed = (each.bounds + time * other.bounds) + ROUNDED * np.abs(each.eigenvalues).max()
        assert (np.abs(each.eigenvalues - time * other.eigenvalues) <= allowed).all()
        places = [np.array([body.position for body in one.scene.body]) for one in (each, other)]
        assert np.allclose(places[0], places[1] / length, rtol=0.0, atol=1e-9)
