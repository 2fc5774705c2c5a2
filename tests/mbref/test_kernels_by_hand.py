"""Small kernels on vectors, series and steps / numbers worked out by hand, with interpreted kernels.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref import rotations
from mbref.equations import coordinates
from mbref.integrators import adams, dop853, one_step, rk4
from mbref.kernels.layout import NOT_FINITE, OK, SINGULAR_AHEAD
from mbref.linear_algebra import elimination, vectors
from mbref.stabilisation import partitioning
from mbref.stepping import loop
from mbref.stepping.loop import STEP_TOO_SMALL
from mbref.taylor import angles, coefficients, samples, saved_state
from mbref.taylor.crossing import determinants, rounding_pole

A, B = (1.0, 2.0, 3.0), (4.0, -5.0, 6.0)


# --- vectors ----------------------------------------------------------------------------------------------
def test_sums_and_products_of_vectors():
    assert vectors.add(A, B) == (5.0, -3.0, 9.0) and vectors.subtract(A, B) == (-3.0, 7.0, -3.0)
    assert vectors.scale(2.0, B) == (8.0, -10.0, 12.0) and vectors.dot(A, B) == 12.0
    assert vectors.cross(A, B) == (27.0, 6.0, -13.0)
    assert vectors.vector(np.array([[9.0] * 3, A]), 1) == A


def test_vectors_in_a_turned_frame():
    """A body turned by 90° about z: its x is Y, its y is -X."""
    rotation = np.array([[1.0, 0, 0, 0, 1, 0, 0, 0, 1], [0.0, -1, 0, 1, 0, 0, 0, 0, 1]])
    assert vectors.to_world(rotation, 1, A) == (-2.0, 1.0, 3.0) and vectors.to_body(rotation, 1, A) == (
        2.0,
        -1.0,
        3.0,
    )
    skew = np.arange(18.0).reshape(2, 9)
    assert vectors.to_world(skew, 1, A) == (62.0, 80.0, 98.0)
    assert vectors.to_body(skew, 1, A) == (78.0, 84.0, 90.0)


def test_vectors_in_tables():
    table, values = np.zeros((2, 6)), np.arange(5.0)
    vectors.put(table, 1, 2, A)
    assert table.tolist() == [[0.0] * 6, [0, 0, 1, 2, 3, 0]]
    vectors.accumulate(values, 1, A)
    assert values.tolist() == [0, 2, 4, 6, 4]
    target = np.zeros(2)
    vectors.copy(values, target)
    assert target.tolist() == [0.0, 2.0]


def test_sizes_and_order():
    assert vectors.larger(2.0, -3.0) == 3.0 and vectors.larger(4.0, -3.0) == 4.0
    assert math.isnan(vectors.larger(4.0, math.nan)) and vectors.largest(np.array([1.0, -7.0, 3.0])) == 7.0
    assert vectors.largest(np.zeros(0)) == 0.0
    assert vectors.all_finite(np.ones(3)) and not vectors.all_finite(np.array([1.0, math.inf]))
    tiny = np.array([0.9e-100, -1.1e-100, 1.0])
    vectors.flush_denormals(tiny)
    assert tiny.tolist() == [0.0, -1.1e-100, 1.0]
    mixed = np.array([3.0, 1.0, 2.0, 1.0, -5.0])
    vectors.sort(mixed)
    assert mixed.tolist() == [-5.0, 1.0, 1.0, 2.0, 3.0]


# --- angles of couplings ----------------------------------------------------------------------------------
def torsion(row: int, factor: float) -> Any:
    """One angle whose directions e₁, e₂ are constant and whose f is linear in two variables:
    f = (u, v, 0.1 u + 0.2 v)."""
    form = np.zeros((9, 2))
    form[6], form[7], form[8] = (1.0, 0.0), (0.0, 1.0), (0.1, 0.2)
    constant = np.array([[1.0, 0.0, 0.5, 0.0, 1.0, -0.5, 0.0, 0.0, 0.0]])
    return SimpleNamespace(row=np.array([row]), factor=np.array([factor]), form=form, constant=constant)


def memory(u: Any, v: Any, near: float = 0.0, row: int = 0) -> Any:
    """Two variables with values and rates, and two rows behind three pivots."""
    terms = np.array([[u[0], v[0]], [u[1], v[1]]])
    return SimpleNamespace(
        polynomials=SimpleNamespace(torsions=torsion(row, 2.0)),
        series=SimpleNamespace(terms=terms),
        solver=SimpleNamespace(phi=np.full(5, 0.25), pivot_columns=np.zeros(3)),
        angles=np.array([near]),
    )


def cosine_and_sine(u: float, v: float) -> tuple[float, float]:
    """e₁ · f = u + 0.05 u + 0.1 v; e₂ · f = v - 0.05 u - 0.1 v."""
    return 1.05 * u + 0.1 * v, 0.9 * v - 0.05 * u


@pytest.mark.parametrize("near", [0.0, 6.0, -7.0])
def test_an_angle_is_added_to_its_row(near):
    made = memory((0.6, 0.0), (0.8, 0.0), near)
    angles.add_angles(made)
    cosine, sine = cosine_and_sine(0.6, 0.8)
    angle = math.atan2(sine, cosine)
    angle += 2 * math.pi * round((near - angle) / (2 * math.pi))
    assert made.solver.phi == pytest.approx([0.25, 0.25, 0.25, 0.25 + 2 * angle, 0.25])
    left_out = memory((0.6, 0.0), (0.8, 0.0), row=-1)
    angles.add_angles(left_out)
    angles.add_angle_rates(left_out)
    assert (left_out.solver.phi == 0.25).all()


def test_the_rate_of_an_angle_is_its_derivative():
    made = memory((0.6, 0.3), (0.8, -0.7))
    angles.add_angle_rates(made)
    h = 1e-6
    ends = [math.atan2(*cosine_and_sine(0.6 + s * 0.3, 0.8 - s * 0.7)[::-1]) for s in (-h, h)]
    assert made.solver.phi[3] == pytest.approx(0.25 + 2 * (ends[1] - ends[0]) / (2 * h), rel=1e-8)
    assert made.solver.phi[[0, 1, 2, 4]].tolist() == [0.25] * 4


def test_the_gradient_of_an_angle():
    """Directions that depend on the variables, too: the derivatives by differences."""
    made = memory((0.6, 0.0), (0.8, 0.0), row=1)
    made.polynomials.torsions.form = np.random.default_rng(3).normal(size=(9, 2))
    matrix = np.full((2, 2), 0.5)
    angles.add_angle_gradients(made.series.terms, matrix, made)

    def phi(u: float, v: float) -> float:
        at = memory((u, 0.0), (v, 0.0), row=1)
        at.polynomials.torsions.form = made.polynomials.torsions.form
        angles.add_angles(at)
        return float(at.solver.phi[4])

    h = 1e-6
    wanted = [
        (phi(0.6 + h, 0.8) - phi(0.6 - h, 0.8)) / (2 * h),
        (phi(0.6, 0.8 + h) - phi(0.6, 0.8 - h)) / (2 * h),
    ]
    assert matrix[1] - 0.5 == pytest.approx(wanted, rel=1e-7) and matrix[0].tolist() == [0.5, 0.5]


# --- series -----------------------------------------------------------------------------------------------
def test_sizes_of_coefficients():
    series = np.array([[9.0, 9.0, 9.0], [1.0, -4.0, 7.0], [2.0, 3.0, -5.0]])
    assert coefficients.largest_coefficient(series, 1, 2) == 4.0
    assert (
        coefficients.largest_coefficient(series, 2, 3) == 5.0
        and coefficients.largest_coefficient(series, 2, 0) == 0.0
    )
    made = SimpleNamespace(
        series=SimpleNamespace(past=series, terms=2 * series[::-1]),
        solver=SimpleNamespace(pivot_columns=np.zeros(2)),
    )
    assert coefficients.distance_moved(0.5, made) == 0.5 * max(4.0, 8.0)
    for rates, turned in (((4.0, 1.0), True), ((4.1, 1.0), False), ((-1.0, 0.0), True)):
        assert bool(coefficients.turns_back(np.array([[0.0, 0.0], rates]), made)) is turned


def test_a_saved_state_is_restored():
    def run(value: float) -> Any:
        clock = SimpleNamespace(time=value, sample=int(value) + 1)
        return SimpleNamespace(
            loop=SimpleNamespace(clock=clock),
            state=SimpleNamespace(coordinates=np.full(7, value), velocities=np.full(6, value + 1)),
            equations=SimpleNamespace(
                angles=np.full(2, value + 2),
                system=SimpleNamespace(counts=SimpleNamespace(crossings=int(value) + 3)),
            ),
        )

    saved = SimpleNamespace(
        instant=SimpleNamespace(), coordinates=np.zeros(7), velocities=np.zeros(6), angles=np.zeros(2)
    )
    saved_state.save_state(run(4.0), saved)
    other = run(9.0)
    saved_state.restore_state(saved, other)
    assert (other.loop.clock.time, other.loop.clock.sample) == (4.0, 5)
    assert other.equations.system.counts.crossings == 7 and other.equations.angles.tolist() == [6.0, 6.0]
    assert other.state.coordinates.tolist() == [4.0] * 7 and other.state.velocities.tolist() == [5.0] * 6


# --- coordinate partitioning -------------------------------------------------------------------------------
def test_the_row_of_a_coupling_by_the_euler_parameters_of_its_bodies():
    """At p = (1, 0, 0, 0) the derivatives by p are (0, 2 Φ_π')."""
    scene = SimpleNamespace(row_bodies=np.array([[2, 0, 1, 3]]))
    system = SimpleNamespace(blocks=np.arange(1.0, 25.0)[None])
    q, a = np.tile([0.0, 0, 0, 1, 0, 0, 0], 3), np.ones((4, 21))
    partitioning.jacobian_by_euler_parameters(q, SimpleNamespace(scene=scene, system=system), a)
    of_bodies = [7, 8, 9, 0, 20, 22, 24], [13, 14, 15, 0, 32, 34, 36], [1, 2, 3, 0, 8, 10, 12]
    assert a[0].reshape(3, 7).tolist() == [*of_bodies]
    assert a[1:].tolist() == (2.0 * np.eye(21)[[3, 10, 17]]).tolist()


# --- steps of integrators ---------------------------------------------------------------------------------
def control(**parts: Any) -> Any:
    return SimpleNamespace(**{"atol": 1e-2, "rtol": 1e-1, "largest_step": 2.0, "order": 4.0, **parts})


def test_the_first_step_of_one_step_methods():
    """Sizes over tolerances: 3 / 0.31 and 2 / 0.02; a hundredth of the ratio."""
    y, rate = np.array([3.0, 0.1]), np.array([0.0, 2.0])
    assert one_step.first_step(y, rate, control()) == pytest.approx(0.01 * (3 / 0.31) / (2 / 0.02))
    assert one_step.first_step(y, 0 * rate, control()) == 2e-6, "nothing moves"


@pytest.mark.parametrize(
    ("ratio", "suggested", "step"),
    [
        (16.0, 1.0, 0.8 * 0.5),
        (1e9, 1.0, 0.2),
        (math.nan, 1.0, 0.25),
        (-1.0, 1.0, 0.25),
        (0.0, 1.0, 100.0),
        (1.0, 1.0, 0.8),
        (0.0625, 1.0, 1.6),
        (1e-12, 1.0, 100.0),
        (1.0, 5.0, 5.0),
    ],
)
def test_the_next_step_of_one_step_methods(ratio, suggested, step):
    """A step of 1 s with an error ratio; a step cut off at a sample does not shorten the suggested one."""
    assert one_step.next_step(1.0, suggested, ratio, 1.0, control()) == pytest.approx(step)
    assert one_step.propose.function(1.0, suggested, ratio, None, None, steps(5)) == pytest.approx(step)


def steps(restart: int, **clock: Any) -> Any:
    """Memory after 5 steps, of which the last had an error of 0.01, since a restart."""
    given = {"restart": restart, "share": 1.0, "past_ratio": 0.01, "past_length": 1.0, **clock}
    return SimpleNamespace(
        loop=SimpleNamespace(clock=SimpleNamespace(**given)),
        equations=SimpleNamespace(system=SimpleNamespace(counts=SimpleNamespace(steps=5))),
        control=control(),
    )


def test_steps_of_growing_errors_are_shorter():
    y, rate = np.array([3.0, 0.1]), np.array([0.0, 2.0])
    factor = 0.8 * 0.16**-0.25
    assert one_step.propose.function(1.0, 1.0, 0.16, y, rate, steps(3)) == pytest.approx(0.5 * factor)
    first = one_step.first_step(y, rate, control())
    assert one_step.propose.function(0.0, 1.0, 0.0, y, rate, steps(3)) == first


def test_the_trend_of_growing_errors():
    """Errors that grew 16-fold from a step of equal length shorten the next step by two."""

    def trend(h: float = 1.0, ratio: float = 0.16, restart: int = 3, **clock: Any) -> float:
        return one_step.trend(h, ratio, steps(restart, **clock))

    assert trend() == pytest.approx(0.5) and trend(past_length=0.5) == pytest.approx(1.0)
    assert trend(h=0.5) == pytest.approx(0.25) and trend(ratio=160.0) == 0.2 and trend(ratio=1e-5) == 1.0
    assert trend(restart=4) == 1.0 and trend(past_ratio=0.0) == 1.0 and trend(ratio=0.0) == 1.0
    assert trend(share=0.019) == 1.0 and trend(share=0.02) == pytest.approx(0.5)
    assert trend(restart=3, past_ratio=0.16) == pytest.approx(1.0)


class Rates:
    """y' = y and -2 t y₂, with the times at which it is asked."""

    def __init__(self, fails_at: int = -1) -> None:
        self.times: list[float] = []
        self.fails_at = fails_at

    def __call__(self, t: float, y: np.ndarray, rate: np.ndarray, memory: Any) -> int:
        self.times.append(t)
        rate[0], rate[1] = y[0], -2 * t * y[1]
        return 7 if len(self.times) == self.fails_at else OK


def start() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.array([1.0, 1.0]), np.array([1.0, -1.0]), np.zeros(2)  # at t = 0.5


def test_a_step_of_rk4(monkeypatch):
    stages = SimpleNamespace(slope=np.zeros(3), total=np.zeros(3))
    monkeypatch.setattr(rk4, "stages_of", lambda given: stages)
    y, rate, new = start()
    rates, h = Rates(), 0.5
    assert rk4.step.function(rates, 0.5, h, y, rate, new, SimpleNamespace(integrator=None)) == 0.0
    assert rates.times == [0.75, 0.75, 1.0]
    k1, k2 = -1.0, -1.5 * 0.75
    k3 = -1.5 * (1 + 0.25 * k2)
    k4 = -2.0 * (1 + 0.5 * k3)
    assert new == pytest.approx(
        [1 + h + h**2 / 2 + h**3 / 6 + h**4 / 24, 1 + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)]
    )
    failing = SimpleNamespace(integrator=None)
    assert rk4.step.function(Rates(2), 0.5, h, y, rate, new, failing) == -7.0


def test_a_step_of_dop853(monkeypatch):
    """State and error of SciPy's integrator, whose error is a root mean square instead of the largest."""
    from scipy.integrate import DOP853

    stages = SimpleNamespace(slopes=np.zeros((12, 3)), errors3=np.zeros(3), errors5=np.zeros(3))
    monkeypatch.setattr(dop853, "stages_of", lambda given: stages)
    made = SimpleNamespace(
        control=control(atol=1e-8, rtol=1e-6),
        integrator=None,
        loop=SimpleNamespace(clock=SimpleNamespace(share=0.5)),
    )
    y, rate, new = start()
    rates = Rates()
    error = dop853.step.function(rates, 0.5, 0.4, y, rate, new, made)
    exact = np.array([math.exp(0.4), math.exp(0.25 - 0.81)])
    assert new == pytest.approx(exact, abs=1e-7) and len(rates.times) == 11
    assert rates.times == pytest.approx(0.5 + 0.4 * DOP853.C[1:])
    k = np.zeros((13, 2))
    k[:12] = stages.slopes[:, :2]
    k[12] = new[0], -1.8 * new[1]
    scale = 0.5 * (1e-8 + 1e-6 * np.maximum(np.abs(y), np.abs(new)))
    fifth, third = (np.abs(DOP853.E5 @ k / scale).max(), np.abs(DOP853.E3 @ k / scale).max())
    assert error == pytest.approx(0.4 * fifth**2 / math.hypot(fifth, 0.1 * third), rel=1e-6)
    assert dop853.step.function(lambda t, y, k, m: k.fill(0.0) or OK, 0.5, 0.4, y, 0 * rate, new, made) == 0.0
    assert dop853.step.function(Rates(3), 0.5, 0.4, y, rate, new, made) == -7.0


def test_error_constants_of_adams():
    """Shampine & Gordon's γ*: 1, 1/2, 1/12, 1/24, 19/720, 3/160."""
    assert adams.GAMMA_STAR[:6] == pytest.approx([1, 1 / 2, 1 / 12, 1 / 24, 19 / 720, 3 / 160])
    assert len(adams.GAMMA_STAR) == 14


def test_coefficients_of_adams_for_equal_steps():
    """Equal steps give g = 1, 1/2, 5/12, 3/8; β = 1; σ = 1, 1, 1, 1. A doubled step gives β = 1, 2, 6."""
    size = adams.HIGHEST + 3

    def past(h: float) -> Any:
        made = {name: np.zeros(size) for name in ("psi", "beta", "g", "sigma", "integrals")}
        given = SimpleNamespace(past_psi=np.array([0.0, 1, 2, 3, 4, 5, *[0.0] * (size - 6)]), **made)
        adams.find_coefficients(h, 3, given)
        return given

    equal = past(1.0)
    assert equal.g[1:5] == pytest.approx([1, 1 / 2, 5 / 12, 3 / 8])
    assert equal.beta[1:5] == pytest.approx(np.ones(4)) and equal.sigma[1:5] == pytest.approx([1, 1, 1, 1])
    assert equal.psi[1:7].tolist() == [1, 2, 3, 4, 5, 6] and equal.psi[7] == equal.beta[7] == 0.0
    double = past(2.0)
    assert double.beta[1:4] == pytest.approx([1, 2 * 1, 2 * 3 / 2]) and double.psi[1:5].tolist() == [
        2,
        3,
        4,
        5,
    ]


def test_the_norm_and_the_first_step_of_adams():
    y, vector = np.array([3.0, 0.0]), np.array([0.31 * 3, 0.01 * 4])
    assert adams.norm(vector, y, control()) == pytest.approx(5.0)
    size = adams.norm(y, y, control())
    assert adams.first_step(y, vector, control()) == pytest.approx(0.25 * math.sqrt(size) / 5.0)
    assert adams.first_step(y, 0 * vector, control()) == 2e-6
    small = np.array([1e-9, 0.0])
    assert adams.first_step(small, np.array([0.01, 0.0]), control()) == pytest.approx(0.25, rel=1e-6)


# --- states of bodies -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "q",
    [
        (0.8, 0.3, -0.4, 0.331662),
        (0.2, 0.9, 0.3, -0.244949),
        (0.1, -0.3, 0.9, 0.3),
        (0.3, 0.2, -0.3, 0.88318),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_quaternion_keeps_the_sign_of_the_one_before(q, sign):
    """One for each of the largest components, of both signs."""
    unit = np.array(q) / math.hypot(*q)
    before = sign * unit + np.array([0.01, -0.02, 0.01, 0.02])
    samples.put_quaternion(rotations.to_matrix(unit).ravel(), before)
    assert before == pytest.approx(sign * unit, abs=1e-15)


def test_the_axial_vector_of_a_rate():
    """A' = A (ω' ×), in the axes of the body."""
    turned, found = rotations.to_matrix(rotations.from_vector(np.array([0.3, -0.7, 0.2]))), np.zeros(3)
    skew = np.array([[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]])
    samples.put_axial_vector(turned.ravel(), (turned @ skew).ravel(), found)
    assert found == pytest.approx([1.0, 2.0, 3.0])


def test_states_are_copied_whole():
    names = ("coordinates", "velocities", "coordinate_rates", "coordinate_second")
    source = SimpleNamespace(**{name: np.arange(3.0) + k for k, name in enumerate(names)})
    target = SimpleNamespace(**{name: np.zeros(3) for name in names})
    coordinates.copy_state(source, target)
    for k, name in enumerate(names):
        assert getattr(target, name).tolist() == [k, k + 1.0, k + 2.0], name


# --- determinants and poles -------------------------------------------------------------------------------
def gradient(work, past) -> Any:
    """Memory of a gradient whose rows and variables are chosen in reverse order."""
    rank = len(past[0])
    return SimpleNamespace(
        solver=SimpleNamespace(
            work=np.array(work),
            pivot_rows=np.arange(rank)[::-1].copy(),
            pivot_columns=np.arange(len(past))[::-1].copy(),
            product=np.zeros((rank, rank)),
            past_gradient=np.array(past),
        ),
        partition=SimpleNamespace(rank=rank),
        step=SimpleNamespace(parity=0, start_parity=0),
    )


def test_determinants_of_gradients():
    """det [1 2; 3 4] = -2, and det G G₀ᵀ of two by three."""
    memory = gradient([[1.0, 2.0], [3.0, 4.0]], [[1.0, 0.0], [0.0, 1.0]])
    negative, size = determinants.square_determinant(memory)
    assert negative and size == pytest.approx(math.log(2.0))
    now = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 3.0]])
    before = np.array([[2.0, 0.0, 1.0], [1.0, -1.0, 0.5]])  # rows in the order of pivots
    negative, size = determinants.product_determinant(gradient(now, before.T))
    exact = np.linalg.det(now[::-1] @ before.T)
    assert negative == (exact < 0.0) and size == pytest.approx(math.log(abs(exact)))


def test_a_pole_is_subtracted_from_every_variable_and_angle():
    """Nine variables in two vectors: a_k - (last) · distance^(order - k), and angles an order earlier."""
    order, distance = 3, 0.5
    past, variable = np.arange(4.0 * 16).reshape(4, 16), np.ones(16)
    variable[9:] = 0.0
    angle = np.array([[10.0, 20.0, 40.0, 7.0]])
    memory = SimpleNamespace(
        mode=SimpleNamespace(order=order),
        series=SimpleNamespace(past=past.copy(), variable=variable, past_angles=angle.copy()),
        solver=SimpleNamespace(pivot_columns=np.zeros(9)),
    )
    rounding_pole.subtract_pole(distance, memory)
    expected = past.copy()
    for k in range(order):
        expected[k] -= variable * past[order] * distance ** (order - k)
    assert memory.series.past.tolist() == expected.tolist()
    assert memory.series.past_angles.tolist() == [[10.0 - 40.0 / 4, 20.0 - 40.0 / 2, 40.0, 7.0]]


# --- steps and orders of Adams ----------------------------------------------------------------------------
def proposing(monkeypatch, **progress: float) -> tuple[Any, Any]:
    """Memory of Adams whose next order is chosen to be 3, and its progress."""
    numbers = {"restart": 1, "order": 5, "next_order": 4, "settled": 1, "failed": 0, "error": 0.5}
    made = SimpleNamespace(**{**numbers, "error_below": 0.3, "equal_steps": 9, **progress})
    past = SimpleNamespace(progress=made, differences=np.zeros((15, 4)))
    monkeypatch.setattr(adams, "past_of", lambda memory: past)
    monkeypatch.setattr(
        adams, "remember", lambda h, order, y_rate, past: setattr(made, "remembered", (h, order))
    )
    monkeypatch.setattr(adams, "choose_order", lambda h, y, past, control: 3)
    clock = SimpleNamespace(restart=1)
    control = SimpleNamespace(order=12)
    return SimpleNamespace(integrator=None, control=control, loop=SimpleNamespace(clock=clock)), past


@pytest.mark.parametrize(
    ("ratio", "settled", "error", "factor"),
    [
        (0.0, 0, 9.0, 2.0),
        (1.0, 1, 1 / 32, 2.0),
        (0.5, 1, 1.01 / 32, 1.0),
        (0.5, 1, 0.5, 1.0),
        (0.5, 1, 0.51, 0.9),
        (0.5, 1, 1.0, 0.5**0.25),
        (0.5, 1, 100.0, 0.5),
    ],
)
def test_the_step_after_an_accepted_one(monkeypatch, ratio, settled, error, factor):
    """At order 3 with the error 0.5 aimed at: doubled where 2⁴ times the error is less."""
    memory, past = proposing(monkeypatch, settled=settled, error=error)
    y = np.zeros(2)
    assert adams.propose.function(0.1, 0.2, ratio, y, y, memory) == pytest.approx(0.1 * factor)
    assert past.progress.order == 3 and past.progress.failed == 0 and past.progress.remembered == (0.1, 5)


@pytest.mark.parametrize(
    ("ratio", "failed", "error", "factor", "order"),
    [
        (1.001, 0, 8.0, 0.5, 4),
        (1.001, 1, 8.0, 0.5, 4),
        (1.001, 2, 8.0, 0.5, 1),
        (1.001, 3, 8.0, 0.25, 1),
        (1.001, 3, 2.0, 0.5, 1),
        (-1.0, 3, 8.0, 0.5, 1),
        (math.nan, 3, 8.0, 0.5, 1),
    ],
)
def test_the_step_after_a_rejected_one(monkeypatch, ratio, failed, error, factor, order):
    """At the third rejection the order becomes 1; from the fourth on the error chooses the step."""
    memory, past = proposing(monkeypatch, failed=failed, error=error, settled=0)
    y = np.zeros(2)
    assert adams.propose.function(0.1, 0.2, ratio, y, y, memory) == pytest.approx(0.1 * factor)
    assert (past.progress.order, past.progress.failed, past.progress.settled) == (order, failed + 1, 1)
    assert not hasattr(past.progress, "remembered")


def test_the_first_step_of_a_chart(monkeypatch):
    memory, past = proposing(monkeypatch, restart=0)
    forgotten = []
    monkeypatch.setattr(adams, "forget", lambda past, restart: forgotten.append(restart))
    monkeypatch.setattr(adams, "first_step", lambda y, y_rate, control: 10 * y[0] + y_rate[0])
    assert adams.propose.function(0.1, 0.2, 0.5, np.array([1.0, 0]), np.array([2.0, 3.0]), memory) == 12.0
    assert forgotten == [1] and past.differences[1].tolist() == [2.0, 3.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("progress", "above", "order", "error"),
    [
        ({"next_order": 4}, 0.0, 4, 0.3),  # the order below has the smaller error
        ({"settled": 0}, 0.0, 6, 0.5),  # at the start the order grows
        ({"settled": 0, "order": 12, "next_order": 12}, 0.4, 11, 0.3),  # the highest order
        ({"equal_steps": 5}, 0.0, 5, 0.5),  # steps were changed lately
        ({"equal_steps": 6}, 0.2, 6, 0.2),
        ({"equal_steps": 6}, 0.3, 4, 0.3),  # equal errors: the lower order
        ({"error_below": 0.6}, 0.5, 5, 0.5),
        ({"error_below": 0.6}, 0.49, 6, 0.49),
        ({"error_below": 0.6, "order": 12, "next_order": 12}, 0.1, 12, 0.5),
        ({"order": 1, "next_order": 1, "error_below": 0.0}, 0.25, 1, 0.5),
        ({"order": 1, "next_order": 1, "error_below": 0.0}, 0.24, 2, 0.24),
    ],
)
def test_the_next_order(monkeypatch, progress, above, order, error):
    numbers = {"order": 5, "next_order": 5, "settled": 1, "error": 0.5, "error_below": 0.3, "equal_steps": 13}
    made = SimpleNamespace(**{**numbers, **progress})
    past = SimpleNamespace(progress=made, differences=np.arange(15.0))
    monkeypatch.setattr(adams, "GAMMA_STAR", 2.0 ** np.arange(15))

    def norm(vector: float, y: object, control: object) -> float:
        assert vector == made.order + 2
        return above / 2.0 ** (made.order + 1)

    monkeypatch.setattr(adams, "norm", norm)
    assert adams.choose_order(1.0, None, past, SimpleNamespace(order=12)) == order
    assert made.error == pytest.approx(error)


# --- elimination ------------------------------------------------------------------------------------------
def test_elimination_with_full_pivoting():
    """Pivots 8 and 2 of a matrix of rank 2; the order of rows and columns, and the factors below them."""
    a = np.array([[1.0, 2.0, 0.0], [0.0, 8.0, 4.0], [2.0, 4.0, 0.0]])
    rows, columns = np.zeros(3, int), np.zeros(3, int)
    assert elimination.full_pivot(a, 3, 3, rows, columns, 1e-12) == 2
    assert rows.tolist() == [1, 2, 0] and columns.tolist() == [1, 0, 2]
    assert a.tolist() == [[8.0, 0.0, 4.0], [0.5, 2.0, -2.0], [0.25, 0.5, 0.0]]
    a = np.array([[1.0, -2.0, 0.0, 7.0], [0.0, 4.0, 9.0, 7.0]])
    rows, columns = np.zeros(2, int), np.zeros(3, int)
    assert elimination.full_pivot(a, 2, 3, rows, columns, 0.0) == 2, "the last column is no part of it"
    assert rows.tolist() == [1, 0] and columns.tolist() == [2, 1, 0]
    for share, rank in ((0.25, 1), (0.2499, 2)):
        a = np.diag([4.0, 1.0])
        assert elimination.full_pivot(a, 2, 2, np.zeros(2, int), np.zeros(2, int), share) == rank, share


def test_products_of_pivots_of_any_size():
    assert elimination.product_of_pivots(np.array([2.0, -3.0, 4.0, 9.0]), 3) == (
        True,
        pytest.approx(math.log(24)),
    )
    negative, size = elimination.product_of_pivots(np.array([-1e200, -1e250, 1e300]), 3)
    assert not negative and size == pytest.approx(750 * math.log(10))
    negative, size = elimination.product_of_pivots(np.array([-1e-140, 1e-140, 1e-140]), 3)
    assert negative and size == pytest.approx(-420 * math.log(10))


# --- coordinate partitioning ------------------------------------------------------------------------------
def turning() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates q, velocities v, and the rates q' = (r', ½ p ω') of two bodies; accelerations."""
    p = np.array([[0.5, -0.5, 0.1, 0.7], [0.3, 0.8, -0.4, 0.33]])
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    v = np.array([[1.0, 2.0, 3.0, 0.4, -0.7, 1.1], [-1.0, 0.5, 2.0, -0.3, 0.9, 0.2]])
    rates = 0.5 * rotations.multiply(p, np.column_stack([np.zeros(2), v[:, 3:]]))
    q = np.column_stack([np.array([[0.1, 0.2, 0.3], [7.0, 8.0, 9.0]]), p])
    return q.ravel(), v.ravel(), np.column_stack([v[:, :3], rates]).ravel(), 0.7 * v.ravel() + 0.1


def test_velocities_of_rates_of_euler_parameters():
    q, v, rates, _ = turning()
    state = SimpleNamespace(coordinates=q, velocities=np.zeros(12), coordinate_rates=rates)
    partitioning.velocities_of_rates(state)
    assert state.velocities == pytest.approx(v)


def test_second_rates_of_euler_parameters():
    """p'' = ½ p (0, ω̇') - ¼ ω² p: the derivative of ½ p (0, ω')."""
    q, v, _, a = turning()
    state = SimpleNamespace(coordinates=q, velocities=v, coordinate_second=np.zeros(14))
    partitioning.second_rates(a, state)
    found, p = state.coordinate_second.reshape(2, 7), q.reshape(2, 7)[:, 3:]
    own, more = v.reshape(2, 6)[:, 3:], a.reshape(2, 6)[:, 3:]
    expected = 0.5 * rotations.multiply(p, np.column_stack([np.zeros(2), more]))
    expected -= 0.25 * (own * own).sum(axis=1)[:, None] * p
    assert found[:, :3] == pytest.approx(a.reshape(2, 6)[:, :3]) and found[:, 3:] == pytest.approx(expected)


def test_the_jacobian_by_euler_parameters():
    """Its products with rates q' are the products of blocks with velocities; the last rows are 2 p."""
    q, v, rates, _ = turning()
    blocks = np.array(
        [[1.0, 2, 3, 4, 5, 6, -1, -2, -3, 0.5, 0.25, 7], [0.0, 1, 0, -2, 3, 1, 9, 9, 9, 9, 9, 9]]
    )
    bodies = np.array([[0, 1], [1, 2]])  # body 2 is the fixed frame
    equations = SimpleNamespace(
        scene=SimpleNamespace(row_bodies=bodies), system=SimpleNamespace(blocks=blocks)
    )
    found = np.full((4, 14), 99.0)
    partitioning.jacobian_by_euler_parameters(q, equations, found)
    wanted = blocks[0] @ v, blocks[1, :6] @ v[6:]
    assert found[:2] @ rates == pytest.approx(wanted)
    assert found[2].tolist() == [0.0] * 3 + (2 * q[3:7]).tolist() + [0.0] * 7
    assert found[3].tolist() == [0.0] * 10 + (2 * q[10:14]).tolist()


def test_dependent_coordinates_are_predicted_from_the_last_step():
    """u + h u' + ½ h² u'' at h = 0.5, of the first two coordinates in the order."""
    scratch = SimpleNamespace(partition=SimpleNamespace(rank=2), column_order=np.array([2, 0, 1]))
    previous = SimpleNamespace(
        coordinates=np.array([1.0, 2.0, 3.0]),
        coordinate_rates=np.array([10.0, 20.0, 30.0]),
        coordinate_second=np.array([8.0, 16.0, 24.0]),
    )
    memory = SimpleNamespace(
        state=SimpleNamespace(coordinates=np.full(3, -1.0)),
        previous=previous,
        watch=SimpleNamespace(accepted_time=1.0),
        chart=scratch,
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(partitioning, "scratch_of", lambda chart: chart)
        partitioning.predict_dependent(1.5, memory)
        assert memory.state.coordinates.tolist() == [1.0 + 5.0 + 1.0, -1.0, 3.0 + 15.0 + 3.0]
        y = np.zeros(6)
        memory.state.coordinate_rates = np.array([0.1, 0.2, 0.3])
        memory.state.coordinates[:] = 4.0, 5.0, 6.0
        assert partitioning.gather_independent(y, memory) == 2
        assert y.tolist() == [5.0, 0.2, 0.0, 0.0, 0.0, 0.0]


def test_the_largest_violation_of_rows_and_unit_quaternions():
    """Φ of row 1, and pᵀp - 1 = 3 of body 0; row 0 is no active row."""
    q = np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0])
    scratch = SimpleNamespace(
        partition=SimpleNamespace(rank=2), row_order=np.array([2, 1, 0]), residual=np.zeros(4)
    )
    rows = SimpleNamespace(phi=np.array([99.0, -5.0]))
    memory = SimpleNamespace(
        state=SimpleNamespace(coordinates=q), equations=SimpleNamespace(rows=rows), chart=scratch
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(partitioning, "scratch_of", lambda chart: chart)
        assert partitioning.find_violation(memory) == 5.0
        assert scratch.residual.tolist() == [3.0, -5.0, 0.0, 0.0]
        rows.phi[1] = math.nan
        assert math.isnan(partitioning.find_violation(memory)), "it is no small violation"


# --- the steps to a sample --------------------------------------------------------------------------------
class Advanced:
    """One call of ``loop.advance`` from 1 s towards 2 s, whose attempts have these error ratios."""

    def __init__(
        self, patch: pytest.MonkeyPatch, ratios: list[float], suggested: list[float], **numbers: float
    ):
        given = {"forced": 0.0, "first": 0.0, "smallest": 1e-3, "fixed": 0.0, "largest": 9.0, "end": math.inf}
        given |= {"steps": 4, "accepted": OK, **numbers}
        self.proposed: list[tuple[float, ...]] = []
        self.tried: list[tuple[float, ...]] = []
        self.accepted: list[tuple[float, ...]] = []
        answers, errors = iter(suggested), iter(ratios)
        self.clock = SimpleNamespace(
            y_size=1, time=1.0, length=0.1, suggested=0.2, ratio=0.3, share=0.0, restart=0, attempt_end=0.0
        )

        def propose(h, before, ratio, y, y_rate, memory):
            self.proposed.append((h, before, ratio))
            return next(answers)

        def step(rates, t, h, y, y_rate, y_new, memory):
            self.tried.append((t, h))
            return next(errors)

        def accept(now, h, suggested, ratio, memory):
            self.accepted.append((now, h, suggested, ratio))
            self.clock.time = now
            return given["accepted"]

        self.counts = SimpleNamespace(steps=given["steps"], rejected=0)
        memory = SimpleNamespace(
            loop=SimpleNamespace(clock=self.clock, y_new=np.zeros(2)),
            control=SimpleNamespace(
                forced_step=given["forced"],
                first_step=given["first"],
                smallest_step=given["smallest"],
                fixed_step=given["fixed"],
            ),
            equations=SimpleNamespace(system=SimpleNamespace(counts=self.counts)),
            kernels=SimpleNamespace(propose=propose, step=step, rates=None),
        )
        patch.setattr(loop, "end_of_pieces", lambda equations: given["end"])
        patch.setattr(loop, "largest_step", lambda memory: given["largest"])
        patch.setattr(loop, "share", lambda suggested, memory: 0.5)
        patch.setattr(loop, "accept_step", accept)
        self.status = loop.advance(2.0, np.zeros(1), np.zeros(1), memory)


@pytest.mark.parametrize(
    ("suggested", "numbers", "h", "now"),
    [
        (0.3, {}, 0.3, 1.3),
        (0.6, {}, 0.5, 1.5),
        (1.0, {}, 1.0, 2.0),
        (7.0, {}, 1.0, 2.0),
        (7.0, {"end": 1.25}, 0.25, 1.25),
        (0.3, {"largest": 0.2}, 0.2, 1.2),
        (0.3, {"first": 0.1, "steps": 0}, 0.1, 1.1),
        (0.3, {"first": 0.1}, 0.3, 1.3),
        (0.01, {"forced": 0.2}, 0.2, 1.2),
        (9.0, {"fixed": 0.3}, 0.25, 1.25),
        (9.0, {"fixed": 0.25}, 0.25, 1.25),
        (9.0, {"fixed": 4.0}, 1.0, 2.0),
    ],
)
def test_the_length_of_a_step_towards_a_sample(monkeypatch, suggested, numbers, h, now):
    run = Advanced(monkeypatch, [0.4], [suggested], **numbers)
    assert run.status == OK and run.proposed == [(0.1, 0.2, 0.3)]
    assert run.tried == [(1.0, pytest.approx(h))] and run.accepted[0][:2] == pytest.approx((now, h))
    assert run.accepted[0][3] == 0.4 and run.counts.rejected == 0 and run.clock.share == 0.5
    assert run.clock.restart == (4 if run.clock.time >= numbers.get("end", math.inf) else 0)


def test_refused_steps_are_proposed_anew(monkeypatch):
    """An error twice the tolerance, a failure of status 3 and a number that is none."""
    run = Advanced(monkeypatch, [2.0, -3.0, math.nan, 1.0], [0.4, 0.3, 0.2, 0.1])
    assert run.status == OK and run.counts.rejected == 3
    assert [h for _, h in run.tried] == pytest.approx([0.4, 0.3, 0.2, 0.1])
    assert run.proposed[1:] == [(0.4, 0.4, 2.0), (0.3, 0.3, -3.0), (0.2, 0.2, -float(NOT_FINITE))]
    assert run.accepted == [(1.1, 0.1, 0.1, 1.0)]


@pytest.mark.parametrize(
    ("ratio", "numbers", "status"),
    [
        (2.0, {}, STEP_TOO_SMALL),
        (-3.0, {}, 3),
        (-3.0, {"fixed": 0.5}, 3),
        (2.0, {"fixed": 0.5}, OK),
        (0.5, {"accepted": SINGULAR_AHEAD}, SINGULAR_AHEAD),
        (0.5, {"accepted": 3}, 3),
    ],
)
def test_steps_that_end_the_run(monkeypatch, ratio, numbers, status):
    """The next step would be shorter than the shortest, or steps are fixed."""
    assert Advanced(monkeypatch, [ratio], [0.4, 0.9e-3], **numbers).status == status


def test_forced_steps_are_taken_whatever_their_error(monkeypatch):
    run = Advanced(monkeypatch, [5.0], [0.1], forced=0.2)
    assert run.status == OK and run.accepted == [(pytest.approx(1.2), 0.2, 0.2, 1.0)]
    run = Advanced(monkeypatch, [5.0, 5.0], [0.4, 0.1], forced=0.2)
    assert [h for _, h in run.tried] == [0.4, 0.2] and run.accepted[0][3] == 1.0


def test_the_fastest_turn_of_a_body():
    v = np.array([9.0, 9, 9, 1, 2, 2, 9, 9, 9, 3, 0, -4, 9, 9, 9, 0, 0, 0])
    assert coordinates.fastest_turn(v) == 5.0 and coordinates.fastest_turn(v[:6]) == 3.0
    assert coordinates.fastest_turn(v[12:]) == 0.0
