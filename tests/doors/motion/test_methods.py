"""Every formulation, stabilisation and integrator has the judge's stored states, as far as it claims."""

from itertools import product

import numpy as np
import pytest

import mbref
from crosscheck.judge.metrics import violation_series
from mbref.cli import main
from mbref.formulations import FORMULATIONS
from mbref.motions.trajectory import Outcome
from mbref.stabilisation import STABILISATIONS
from tests.helpers.errors import pose_error, rate_error
from tests.helpers.exact_motions import stored
from tests.helpers.short_motions import MOTIONS, times_of

RTOL = 1e-10
ITERATED = {"alf"}  # its accelerations are as exact as its iteration, 1e-9 relative
GENERAL = [name for name, part in FORMULATIONS.items() if not part.needs_independent_columns]
INDEPENDENT = ("pendulum with spring with damping", "gears with armature", "driven angle by a sine")
INDEPENDENT += ("loop with inline",)
MASSLESS = "massless link between slides"
REDUNDANT = {"four hinges": 3, "doubled hinge": 5}  # rows - rank: 20 - 17 and 10 - 5


def errors(name: str, method: str, rtol: float = RTOL) -> tuple[float, float, mbref.Motion]:
    """Return the errors of states and rates of a short motion, and the run, which completes."""
    scene = MOTIONS[name]()
    run = mbref.simulate(scene, method, times=times_of(scene), rtol=rtol)
    assert run.outcome is Outcome.COMPLETED, run.message
    return pose_error(run, stored()[name]), rate_error(run, stored()[name]), run


def limit(formulation: str) -> float:
    """Return the largest error of poses at ``RTOL``: a fifth of the tolerance if nothing is iterated.
    Measured errors are about a fiftieth of it. Rates have three times as much."""
    return (1.0 if formulation in ITERATED else 0.2) * RTOL


@pytest.mark.parametrize("stabilisation", STABILISATIONS)
@pytest.mark.parametrize("formulation", GENERAL)
def test_every_formulation_has_the_judges_states_with_every_stabilisation(formulation, stabilisation):
    """All except `mpi-gs-literal` (below). Errors against the judge are within `limit`. Runs take 10 steps,
    or 19 by iterated accelerations; a stabilisation that disturbs the motion would need many more than 30."""
    pose, rate, run = errors("arm with universal", f"{formulation}+{stabilisation}")
    assert pose < limit(formulation)
    assert rate < 3 * limit(formulation)
    assert run.cost.steps <= 30


@pytest.mark.parametrize(
    ("formulation", "name"),
    [
        *product(GENERAL, INDEPENDENT),
        *product([n for n in GENERAL if FORMULATIONS[n].handles_redundancy], REDUNDANT),
        *product([n for n in GENERAL if FORMULATIONS[n].handles_singular_mass], [MASSLESS]),
    ],
)
def test_every_formulation_has_the_judges_states_with_the_rows_and_masses_that_it_claims(formulation, name):
    """INDEPENDENT have springs, gears, drivers and loops whose constraint rows are independent. Some
    formulations claim to solve redundant rows, too: four hinges on parallel axes, and two of one axis; some
    claim a link without mass, here between two slides."""
    pose, rate, _ = errors(name, f"{formulation}+projection")
    assert pose < limit(formulation)
    assert rate < 3 * limit(formulation)


@pytest.mark.parametrize(
    ("formulation", "name"),
    [
        *product([n for n in GENERAL if not FORMULATIONS[n].handles_redundancy], REDUNDANT),
        *product([n for n in GENERAL if not FORMULATIONS[n].handles_singular_mass], [MASSLESS]),
    ],
)
def test_formulation_without_a_claim_ends_at_once_with_redundant_rows_or_a_massless_body(formulation, name):
    """Without the claim `handles_redundancy` or `handles_singular_mass` the leading matrix is singular: the
    run has no sample. Its message has the number of redundant rows (REDUNDANT), or the massless 'bridge'."""
    scene = MOTIONS[name]()
    run = mbref.simulate(scene, f"{formulation}+projection", times=times_of(scene))
    said = {MASSLESS: "body 'bridge' lacks mass"}
    said |= {key: f"constraint rows are redundant ({rows} of" for key, rows in REDUNDANT.items()}
    assert run.outcome is Outcome.SINGULAR_MATRIX and run.t_end == 0.0 and said[name] in run.message


@pytest.mark.parametrize("stabilisation", ["none", "projection"])
def test_gram_schmidt_as_printed_has_the_judges_states_of_a_fully_driven_mechanism(stabilisation):
    """mpi-gs-literal is the algorithm as the paper prints it. Drivers prescribe all freedoms of the slider-
    crank. Errors of its poses against the judge are below rtol / 5, 1e-10 (``limit``)."""
    pose, _, _ = errors("spatial_slider_crank_driven", f"mpi-gs-literal+{stabilisation}")
    assert pose < limit("mpi-gs-literal")


def test_gram_schmidt_as_printed_reports_a_singular_matrix_for_a_free_mechanism():
    """The algorithm as the paper prints it needs as many independent rows as coordinates."""
    free = MOTIONS["four hinges"]()
    assert mbref.simulate(free, "mpi-gs-literal+none", times=[0.1]).outcome is Outcome.SINGULAR_MATRIX


@pytest.mark.parametrize("stabilisation", STABILISATIONS)
@pytest.mark.parametrize("name", ["arm with universal", "pendulum with moment that is switched"])
def test_rk4_has_order_four(name, stabilisation):
    """Halved steps have 2⁻⁴ of the error against the judge, also on both sides of a switch. Errors are no
    pure powers of such steps: orders from 3.5 to 5.0 are accepted."""
    coarse, _, _ = errors(name, f"lm2+{stabilisation}/rk4[step=4e-3]")
    fine, _, _ = errors(name, f"lm2+{stabilisation}/rk4[step=2e-3]")
    assert 3.5 < np.log2(coarse / fine) < 5.0


@pytest.mark.parametrize("stabilisation", STABILISATIONS)
@pytest.mark.parametrize(
    ("options", "fewest", "most"), [("", 30, 70), ("[max_order=4]", 100, 180)], ids=["order 12", "order 4"]
)
def test_adams_meets_its_tolerance_in_about_50_steps_or_130_at_order_4(options, fewest, most, stabilisation):
    """The error against the judge is below rtol = 1e-9, of rates below three times as much. Measured were 49
    to 58 steps, and 115 to 145 with orders up to four."""
    pose, rate, run = errors("arm with universal", f"mpi-qr+{stabilisation}/adams{options}", rtol=1e-9)
    assert pose < 1e-9
    assert rate < 3e-9
    assert fewest < run.cost.steps < most


@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
@pytest.mark.parametrize("method", ["lm2+projection", "lm2+projection/adams", "taylor"])
def test_error_of_poses_of_a_damped_pendulum_is_at_most_ten_times_the_tolerance(method, rtol):
    """The judge has the exact states of a damped pendulum; local errors of the few steps add up."""
    pose, _, _ = errors("pendulum with spring with damping", method, rtol)
    assert pose < 10 * rtol


def test_baumgartes_feedback_keeps_constraint_violations_small_that_grow_without_it():
    """Fixed steps of 10 ms: without feedback the violation more than doubles from 1 s to 2 s. With gains
    α = β = 5 1/s the violation is less than half as large at 1 s, and less than a twentieth at 2 s."""
    scene = MOTIONS["loop with inline"]().with_(duration=2.0)
    without, fed_back = (
        mbref.simulate(scene, f"lm2+{name}/rk4[step=1e-2]", times=[1.0, 2.0]).violation.position
        for name in ("none", "baumgarte[alpha=5,beta=5]")
    )
    assert without[1] > 2 * without[0] > 0.0
    assert fed_back[0] < without[0] / 2
    assert fed_back[1] < without[1] / 20


@pytest.mark.parametrize("name", ["gears with armature", "arm with universal"])
def test_projection_keeps_joints_closed_to_rounding(name):
    """The judge computes how far joints are open (level 0) and at which rate (level 1), in lengths or rad.
    Without projection steps of 10 ms open them 1000 times as far and more."""
    rounding = 5e-15  # 22 units of 2⁻⁵²; 4 are measured, at rates up to 2 rad/s
    closed, drifted = (errors(name, f"lm2+{s}/rk4[step=1e-2]")[2] for s in ("projection", "none"))
    for level in (0, 1):
        assert violation_series(MOTIONS[name](), closed, level).max() < rounding
        assert violation_series(MOTIONS[name](), drifted, level).max() > 1000 * rounding


def test_sweep_has_a_motion_for_each_pair_of_gains_with_its_own_gains():
    """Labels name gains. Feedback of 50 /s and (50 /s)² violates constraints less than a fifth as much."""
    gains = {"alpha": [0, 50], "beta": [0, 50]}
    runs = mbref.sweep("planar_slider_crank", "mpi-svd+baumgarte/rk4[step=1e-3]", gains, [0.05])
    violation = {label: motion.violation.position[-1] for label, motion in runs.items()}
    assert list(violation) == [f"alpha = {a}, beta = {b}" for a in (0, 50) for b in (0, 50)]
    assert 0.0 < violation["alpha = 50, beta = 50"] < violation["alpha = 0, beta = 0"] / 5


def test_sweep_has_a_motion_for_values_that_are_equal_to_six_digits():
    """Labels of motions have as many digits as their values need."""
    found = mbref.sweep("point_pendulum", "lm1+none/rk4", {"step": [0.01, 0.0100000001]}, [0.01])
    assert list(found) == ["step = 0.01", "step = 0.0100000001"]


def test_option_that_is_varied_twice_is_refused(capsys):
    """A plot has the values of one list: a second list would replace the first one, also by another name."""
    assert main(["plot", "four_bar", "--method", "lm1+baumgarte", *("--vary", "alpha=5") * 2]) == 2
    assert capsys.readouterr().err == "--vary: alpha is given twice; give it once\n"
    with pytest.raises(mbref.InputError, match=r"'alpha' and 'baumgarte\.alpha' are one option"):
        mbref.sweep("four_bar", "lm1+baumgarte", {"alpha": [1.0], "baumgarte.alpha": [2.0]})


def test_option_of_two_parts_of_a_method_is_varied_by_the_name_of_its_part():
    """The formulation alf and the stabilisation baumgarte both have an option alpha."""
    method = mbref.Method.parse("alf+baumgarte")
    assert str(method.with_option("baumgarte.alpha", 7.0)) == "alf+baumgarte[alpha=7]/dop853"
    with pytest.raises(mbref.MethodError, match="2 parts have an option 'alpha'"):
        method.with_option("alpha", 7.0)


@pytest.mark.parametrize("formulation", ["alf-dual", "mpi-svd"])
def test_velocities_across_the_plane_decay_to_zero_instead_of_denormals(formulation):
    """Denormal numbers, below 2e-308, slow a processor down. Velocities that projection halves again and
    again pass 1e-90 on the way to them: none is between zero and this."""
    scene, method = mbref.find_scene("four_bar_chain[1]"), f"{formulation}+projection/rk4[step=0.01]"
    run = mbref.simulate(scene, method, times=[0.5])
    values = np.abs(np.concatenate([run.velocity, run.angular_velocity], axis=None))
    left = values[(values > 0) & (values < 1e-90)]
    assert not left.size, f"{left.size} velocities have decayed to {left.max():.0e}"
