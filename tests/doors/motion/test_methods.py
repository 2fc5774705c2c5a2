"""Every formulation, stabilisation and integrator has the judge's stored states, as far as it claims."""

from __future__ import annotations

import numpy as np
import pytest

import mbref
from mbref.formulations import FORMULATIONS
from mbref.motions.trajectory import Outcome
from mbref.stabilisation import STABILISATIONS
from tests.helpers.errors import pose_error, rate_error
from tests.helpers.exact_motions import stored
from tests.helpers.short_motions import MOTIONS, times_of

RTOL = 1e-10
ITERATED = {"alf"}  # its accelerations are as exact as its iteration, 1e-9 relative
GENERAL = [name for name, part in FORMULATIONS.items() if not part.needs_independent_columns]
INDEPENDENT = (
    "pendulum with spring with damping",
    "gears with armature",
    "driven angle by a sine",
    "loop with inline",
)
REDUNDANT = ("four hinges", "doubled hinge")


def errors(name: str, method: str, rtol: float = RTOL) -> tuple[float, float, mbref.Motion]:
    """Return the errors of states and rates of a short motion, and the run, which completes."""
    scene = MOTIONS[name]()
    run = mbref.simulate(scene, method, times=times_of(scene), rtol=rtol)
    assert run.outcome is Outcome.COMPLETED, run.message
    return pose_error(run, stored()[name]), rate_error(run, stored()[name]), run


def limit(formulation: str) -> float:
    """Return the largest error of a motion at ``RTOL``, a fifth of the tolerance if nothing is iterated."""
    return (1.0 if formulation in ITERATED else 0.2) * RTOL


@pytest.mark.parametrize("stabilisation", STABILISATIONS)
@pytest.mark.parametrize("formulation", GENERAL)
def test_every_formulation_has_the_judges_states_with_every_stabilisation(formulation, stabilisation):
    """Errors are within `limit`. Runs take 10 steps, or 19 if accelerations are iterated; a stabilisation
    that disturbs the motion would need many more than 30."""
    pose, rate, run = errors("arm with universal", f"{formulation}+{stabilisation}")
    assert pose < limit(formulation)
    assert rate < 3 * limit(formulation)
    assert run.cost.steps <= 30


@pytest.mark.parametrize("name", INDEPENDENT)
@pytest.mark.parametrize("formulation", GENERAL)
def test_every_formulation_has_the_judges_states_where_rows_are_independent(formulation, name):
    pose, rate, _ = errors(name, f"{formulation}+projection")
    assert pose < limit(formulation)
    assert rate < 3 * limit(formulation)


@pytest.mark.parametrize("name", REDUNDANT)
@pytest.mark.parametrize("formulation", GENERAL)
def test_redundant_rows_are_solved_or_reported_as_the_formulation_claims(formulation, name):
    scene = MOTIONS[name]()
    if FORMULATIONS[formulation].handles_redundancy:
        pose, rate, _ = errors(name, f"{formulation}+projection")
        assert pose < limit(formulation)
        assert rate < 3 * limit(formulation)
        return
    run = mbref.simulate(scene, f"{formulation}+projection", times=times_of(scene))
    redundant = mbref.counts(scene).redundant
    assert run.outcome is Outcome.SINGULAR_MATRIX
    assert run.t_end == 0.0
    assert f"constraint rows are redundant ({redundant} of" in run.message


@pytest.mark.parametrize("stabilisation", ["none", "projection"])
def test_gram_schmidt_as_printed_solves_mechanisms_only_if_drivers_prescribe_all_freedoms(stabilisation):
    pose, _, _ = errors("spatial_slider_crank_driven", f"mpi-gs-literal+{stabilisation}")
    assert pose < limit("mpi-gs-literal")
    free = MOTIONS["four hinges"]()
    assert mbref.simulate(free, "mpi-gs-literal+none", times=[0.1]).outcome is Outcome.SINGULAR_MATRIX


@pytest.mark.parametrize("stabilisation", STABILISATIONS)
@pytest.mark.parametrize("name", ["arm with universal", "pendulum with moment that is switched"])
def test_rk4_has_order_four(name, stabilisation):
    """Halved steps have a sixteenth of the error, also on both sides of a switch."""
    coarse, _, _ = errors(name, f"lm2+{stabilisation}/rk4[step=4e-3]")
    fine, _, _ = errors(name, f"lm2+{stabilisation}/rk4[step=2e-3]")
    assert 3.5 < np.log2(coarse / fine) < 5.0


@pytest.mark.parametrize("stabilisation", STABILISATIONS)
@pytest.mark.parametrize("options", ["", "[max_order=4]"])
def test_adams_meets_its_tolerance_with_more_steps_at_a_lower_order(options, stabilisation):
    """A tenth of the tolerance or more is used: 47 to 58 steps, and 115 to 145 at the order four."""
    pose, rate, run = errors("arm with universal", f"mpi-qr+{stabilisation}/adams{options}", rtol=1e-9)
    assert 1e-12 < pose < 1e-9
    assert rate < 3e-9
    assert run.cost.steps < 70 if not options else 100 < run.cost.steps < 180


@pytest.mark.parametrize("method", ["lm2+projection", "lm2+projection/adams", "taylor"])
def test_error_of_poses_is_at_most_ten_times_the_tolerance(method):
    for rtol in (1e-5, 1e-8, 1e-11):
        pose, _, _ = errors("pendulum with spring with damping", method, rtol)
        assert pose < 10 * rtol


def test_feedback_bounds_the_drift_of_constraints():
    """Violations grow in steps of 10 ms without feedback; gains of 5 1/s make them decay within a second."""
    scene = MOTIONS["loop with inline"]().with_(duration=2.0)
    free, fed = (
        mbref.simulate(scene, f"lm2+{name}/rk4[step=1e-2]", times=[1.0, 2.0]).violation.position
        for name in ("none", "baumgarte[alpha=5,beta=5]")
    )
    assert free[1] > 2 * free[0] > 1e-5
    assert fed.max() < 0.5 * free[0]
    assert fed[1] < 0.05 * free[1]


@pytest.mark.parametrize("name", ["gears with armature", "arm with universal"])
def test_projection_keeps_joints_closed_to_rounding(name):
    for stabilisation, most in (("none", 1e-9), ("projection", 1e-13)):
        _, _, run = errors(name, f"lm2+{stabilisation}/rk4[step=2e-3]")
        assert run.violation.position.max() < most
        assert run.violation.velocity.max() < 100 * most


def test_body_without_mass_is_moved_or_refused_by_name_as_the_formulation_claims():
    motion = "massless link between slides"
    scene = MOTIONS[motion]()
    for name in GENERAL:
        if FORMULATIONS[name].handles_singular_mass:
            assert errors(motion, f"{name}+projection")[0] < limit(name)
        else:
            run = mbref.simulate(scene, f"{name}+projection", times=times_of(scene))
            assert run.outcome is not Outcome.COMPLETED and "body 'bridge' lacks mass" in run.message
