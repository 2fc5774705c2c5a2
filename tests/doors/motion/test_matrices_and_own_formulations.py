"""Matrices of the equations against the judge, differences and units; formulations of a user's own."""

import numpy as np
import pytest

import mbref
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_principle import gauss
from mbref import rotations
from mbref.scene import Factor
from tests.helpers import loads_over_time
from tests.helpers.changed_scenes import in_other_units
from tests.helpers.coupled_mechanisms import gear_pair
from tests.helpers.powered_mechanisms import powered_mechanism
from tests.helpers.short_motions import MOTIONS

STEP = 1e-6  # m, rad and s; central differences are exact to rounding over the step, about 1e-9
CLOSE = 1e-8  # of accelerations of formulations by pseudo-inverses, and of runs at rtol 1e-10


def moved(T, change):
    """Return the coordinates q of matrices, with each body displaced by δr (m) and turned by δπ' (rad) about
    its own axes; ``change`` has these six numbers for each body."""
    q, x = T.q.reshape(-1, 7).copy(), np.reshape(change, (-1, 6))
    q[:, :3] += x[:, :3]
    q[:, 3:] = rotations.multiply(q[:, 3:], np.insert(x[:, 3:] / 2, 0, 1.0, axis=1))
    return q.ravel()


@pytest.mark.parametrize("seed", range(8))
def test_matrices_of_random_mechanisms_have_the_judges_accelerations(seed):
    """Gauss's principle of the judge is the truth of q̈ at the start. The matrices must also satisfy M q̈ +
    Φ_qᵀ λ = g, Φ_q q̈ = γ, Φ_q v = ν and Φ = 0. Mechanisms have armatures, couplings, drivers, massless links
    and a modelled ground. Rounding leaves at most 1e-9 of the largest number."""
    scene = powered_mechanism(seed)
    T, exact = mbref.terms(scene), gauss(scene)
    assert T.M is not None and T.g is not None
    qdd, poses = T.qdd.reshape(-1, 6)[: len(scene.body)], T.q.reshape(-1, 7)[: len(scene.body)]
    length = scene_length(scene)  # of angular accelerations as accelerations
    world = np.vstack([qdd[:, :3], length * rotations.rotate(poses[:, 3:], qdd[:, 3:])])
    assert np.abs(world - exact.reshape(world.shape)).max() < 1e-9 * np.abs(exact).max()
    size = max(np.abs(T.g).max(), np.abs(T.M @ T.qdd).max())
    assert np.abs(T.M @ T.qdd + T.Phi_q.T @ T.lam - T.g).max() < 1e-9 * size
    assert np.abs(T.Phi_q @ T.qdd - T.gamma).max() < 1e-9 * max(1.0, np.abs(T.qdd).max())
    assert np.abs(T.Phi_q @ T.v - T.nu).max() < 1e-10 * max(1.0, np.abs(T.v).max())
    assert np.abs(T.Phi).max() < 1e-10


@pytest.mark.parametrize(
    "name", [n for n in MOTIONS if n.startswith(("arm with", "driven", "coupled", "planet"))]
)
def test_jacobian_and_right_hand_sides_are_differences_of_the_constraints(name):
    """Columns of Φ_q = ∂Φ/∂q are differences of Φ. As d/dt (Φ_q v - ν) = Φ_q q̈ - γ, it is -γ along a motion
    of constant velocities v. The random state violates them. Limits: CLOSE, ten times it for γ."""
    scene = MOTIONS[name]()
    rng, start = np.random.default_rng(5), mbref.terms(scene)
    n = len(start.columns)
    v = rng.normal(size=n)
    T = mbref.terms(scene, 0.1, (moved(start, 0.1 * rng.normal(size=n)), v))
    for k in rng.choice(n, size=6, replace=False):
        ends = [mbref.terms(scene, T.t, (moved(T, sign * STEP * np.eye(n)[k]), v)).Phi for sign in (1, -1)]
        assert np.abs((ends[0] - ends[1]) / (2 * STEP) - T.Phi_q[:, k]).max() < CLOSE, T.columns[k]
    rates = []
    for sign in (1, -1):
        state = moved(T, sign * STEP * v), v
        after = mbref.terms(scene, T.t + sign * STEP, state)
        rates.append(after.Phi_q @ v - after.nu)
    limit = 10 * CLOSE * max(1.0, np.abs(T.gamma).max())
    assert np.abs((rates[0] - rates[1]) / (2 * STEP) + T.gamma).max() < limit


def test_units_of_rows_say_how_they_scale_with_the_mechanism():
    """A mechanism of ten times the size, moved alike: rows in m are ten times as large, rows in rad equal."""
    small, rng = mbref.find_scene("spatial_slider_crank_driven"), np.random.default_rng(0)
    change = 0.05 * rng.normal(size=(3, 6))
    found = []
    for factor, scene in ((1.0, small), (10.0, in_other_units(small, 1.0, 10.0, 1.0))):
        T = mbref.terms(scene)
        found.append(mbref.terms(scene, state=(moved(T, change * ([factor] * 3 + [1.0] * 3)), T.v)).Phi)
    expected = np.where(np.array(mbref.terms(small).row_units) == "m", 10.0, 1.0)
    assert set(expected) == {1.0, 10.0} and np.allclose(found[1], expected * found[0], rtol=1e-9, atol=1e-13)


def test_matrices_along_a_motion_have_its_energy_reactions_and_labels():
    """½ vᵀ M v is the kinetic energy. Rows "B: point" of Φ are the anchor's place on the first body minus
    that on the second body. So the force -Φ_qᵀ λ on the second body is λ, the motion's reaction. Energies and
    velocities agree to rounding, forces to rtol, 1e-9."""
    motion = mbref.simulate("spatial_slider_crank_gravity", times=[0.3])
    T = mbref.terms("spatial_slider_crank_gravity", t=0.3)
    assert 0.5 * T.v @ T.M @ T.v == pytest.approx(motion.kinetic_energy[0], rel=1e-12)
    rows = [T.rows.index(f"B: point {axis}") for axis in "xyz"]
    assert T.lam[rows] == pytest.approx(motion.joint("B").force[0], rel=1e-9)
    b = T.columns.index("rod x")
    assert T.v[b : b + 3] == pytest.approx(motion["rod"].velocity[0], rel=1e-12)
    assert T.rank == len(T.rows) == len(set(T.rows)), "rows are independent and have labels of their own"


def pseudo_inverse(T):
    """Return q̈ by the pseudo-inverse of Φ_q M^-½, for a diagonal mass matrix M."""
    root, free = np.diag(T.M) ** -0.5, T.g / np.diag(T.M)
    return free + root * (np.linalg.pinv(T.Phi_q * root, rcond=1e-10) @ (T.gamma - T.Phi_q @ free))


def augmented(T):
    """Return q̈ and λ by Lagrange multipliers, with Baumgarte's feedback of violations (10 1/s)."""
    n, m = len(T.v), len(T.Phi)
    matrix = np.block([[T.M, T.Phi_q.T], [T.Phi_q, np.zeros((m, m))]])
    right = np.r_[T.g, T.gamma - 20 * (T.Phi_q @ T.v - T.nu) - 100 * T.Phi]
    x = np.linalg.lstsq(matrix, right, rcond=1e-13)[0]
    return x[:n], x[n:]


@pytest.mark.parametrize(("formulation", "chart"), [(pseudo_inverse, "projection"), (augmented, "none")])
def test_own_formulation_turns_a_gear_pair_by_its_closed_form(formulation, chart):
    """Wheel A turns by α t² / 2, up to 12.5 rad, and wheel B by r = -½ of it: α = M / (J_A + r² J_B) with M =
    2 N m, J_A = 0.03 and J_B = 0.2 kg m². The moment of bearing B accelerates its wheel: r α J_B. On wheel A
    the load acts, too: α J_A - M."""
    times = np.linspace(0.0, 1.0, 5)
    own = {"formulation": formulation, "stabilisation": chart}
    motion = mbref.simulate(gear_pair(), times=times, rtol=1e-10, **own)
    assert motion.outcome.name == "COMPLETED"
    assert motion.method.startswith(f"own:{formulation.__name__}+{chart}")
    rate = 2.0 / (0.03 + 0.25 * 0.2)
    assert motion.joint("A").angle == pytest.approx(rate * times**2 / 2, abs=CLOSE)
    assert motion.joint("B").angle == pytest.approx(-0.5 * rate * times**2 / 2, abs=CLOSE)
    assert motion.joint("A").moment[:, 2] == pytest.approx(rate * 0.03 - 2.0, rel=CLOSE)
    assert motion.joint("B").moment[:, 2] == pytest.approx(-0.5 * rate * 0.2, rel=CLOSE)


def test_projection_holds_the_joints_of_an_own_formulation_to_rounding():
    """The formulation is a pseudo-inverse; violations of a gear pair are in m and rad."""
    own = {"formulation": pseudo_inverse, "stabilisation": "projection"}
    motion = mbref.simulate(gear_pair(), times=[0.5, 1.0], **own)
    assert motion.violation.position.max() < 1e-13  # 500 roundings


def test_own_formulation_follows_loads_that_are_switched():
    """A force of 1 N/kg acts from 0.5 s to 1.5 s: x = (t - 0.5)² / 2, up to 0.5 m and 1 m/s, and then x grows
    by 1 m/s. The sample at a switch has the acceleration after it. Errors are at most rtol, 1e-9."""
    scene = loads_over_time.pushed(Factor(start=0.5, stop=1.5))
    motion = mbref.simulate(scene, times=[0.0, 0.5, 1.0, 1.5, 2.0], formulation=pseudo_inverse)
    along = motion.joint("J").displacement
    assert along == pytest.approx([0.0, 0.0, 0.125, 0.5, 1.0], abs=1e-9)
    assert motion.acceleration[:, 0] @ loads_over_time.AXIS == pytest.approx([0, 1, 1, 0, 0], abs=1e-9)


def test_own_stabilisation_replaces_the_state_after_each_step():
    """The function returns q and zero velocities: bodies are at rest at every later sample."""
    seen = []

    def stopped(T):
        seen.append(T.t)
        return T.q, T.v * 0.0

    motion = mbref.simulate("point_pendulum", duration=0.2, formulation=augmented, stabilisation=stopped)
    assert len(seen) == motion.cost.steps and np.abs(motion.velocity[1:]).max() == 0.0


@pytest.mark.parametrize(
    ("formulation", "outcome", "says"),
    [
        (lambda T: np.linalg.inv(np.zeros((2, 2))), "SINGULAR_MATRIX", "Singular matrix at t = 0 s"),
        (lambda T: T.v + np.nan, "NOT_FINITE", ""),
        (lambda T: T.g + 1.0, "VIOLATION", "joint"),
    ],
    ids=["no inverse", "not a number", "leaves the constraints"],
)
def test_own_formulation_that_fails_ends_the_run_with_the_outcome_of_its_failure(formulation, outcome, says):
    """The function inverts zeros, returns NaN, or returns numbers with which the pendulum's joint opens."""
    ended = mbref.simulate("point_pendulum", formulation=formulation)
    assert ended.outcome.name == outcome and says in ended.message


@pytest.mark.parametrize(
    ("faulty", "says"),
    [
        ({"formulation": lambda T: T.q}, r"must return q̈ of shape \(6,\)"),
        ({"formulation": augmented, "method": "lm1"}, "not both"),
        ({"formulation": augmented, "stabilisation": "baumgarte"}, "must be none, projection or a function"),
        ({"stabilisation": "projection"}, "needs a formulation of your own"),
    ],
    ids=["q for its acceleration", "method and formulation", "gains of another method", "projection alone"],
)
def test_own_functions_of_wrong_shape_or_wrong_combination_are_refused(faulty, says):
    """The pendulum has one body: q̈ has six numbers, q seven."""
    with pytest.raises(mbref.InputError, match=says):
        mbref.simulate("point_pendulum", **faulty)


def test_state_of_matrices_with_a_wrong_shape_is_refused_with_the_right_one():
    """The pendulum has one body: a position and a quaternion, seven coordinates. Six are given."""
    with pytest.raises(mbref.InputError, match=r"state: must be finite coordinates \(7,\)"):
        mbref.terms("point_pendulum", state=(np.zeros(6), np.zeros(6)))
