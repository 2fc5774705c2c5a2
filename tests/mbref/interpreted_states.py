"""States of bodies from series and back, with interpreted kernels / polynomials and turning matrices by hand.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import rotations
from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.kernels.layout import NOT_CONVERGED, OK
from mbref.taylor import loads, mode, pose_maps, samples, saved_state, step_start, stepping
from mbref.taylor.crossing import acceptance, detection, short_crossing

LANES, ORDER = 16, 6


def waves(*shape: int, seed: float = 0.0) -> np.ndarray:
    """Return numbers between -1 and 1, none of which repeats."""
    return np.cos(seed + 2.4 * np.arange(np.prod(shape))).reshape(shape)


def memory(**more: Any) -> Any:
    """Memory of 2 bodies and 3 variables in 16 lanes, with an angle of a torsion spring in slot 1."""
    made = SimpleNamespace(
        series=SimpleNamespace(
            past=waves(ORDER + 1, LANES),
            terms=waves(ORDER + 1, LANES, seed=1.0),
            past_angles=waves(1, ORDER + 1),
        ),
        solver=SimpleNamespace(pivot_columns=np.arange(3)),
        step=SimpleNamespace(used_order=4, last_order=4, time_to_pole=9.0),
        state=np.full((3, LANES), 9.0),
        pose=np.full((3, 24), 9.0),
        polynomials=SimpleNamespace(torsions=SimpleNamespace(slot=np.array([1])), **more),
        angles=np.zeros(1),
        mode=SimpleNamespace(kind=mode.HIGH_ACCURACY, tolerance=0.0, order=3),
        options=SimpleNamespace(
            regular_tolerance=1e-6, regular_order=8, accurate_tolerance=1e-13, accurate_order=22
        ),
        waiting=SimpleNamespace(
            state=np.zeros((3, 3 * LANES)), angles=np.zeros((3, 1)), exact=np.zeros(3, int)
        ),
        run=SimpleNamespace(
            state=SimpleNamespace(coordinates=np.zeros(14), velocities=np.zeros(12)),
            equations=SimpleNamespace(
                angles=np.zeros(2), system=SimpleNamespace(acceleration=np.zeros(12)), frames=None
            ),
            loop=SimpleNamespace(clock=SimpleNamespace(sample=1, time=2.0, length=0.5)),
        ),
    )
    made.run.state.coordinates[[3, 10]] = 1.0
    return made


@pytest.mark.parametrize("used", [2, 4, 6])
def test_all_lanes_and_two_derivatives_at_a_time(used):
    made = memory()
    made.step.used_order = used
    samples.evaluate_series(0.3, made)
    columns = [np.polynomial.Polynomial(made.series.past[: used + 1, j]) for j in range(LANES)]
    for order in range(3):
        expected = [column.deriv(order)(0.3) for column in columns]
        assert made.state[order] == pytest.approx(expected, abs=1e-14), order


def test_angles_and_a_sample_that_waits():
    made = memory()
    samples.keep_sample(0.25, made)
    angle = np.polynomial.Polynomial(made.series.past_angles[0, :5])(0.25)
    assert made.angles[0] == made.run.equations.angles[1] == made.waiting.angles[1, 0] == pytest.approx(angle)
    assert made.run.equations.angles[0] == 0.0 and made.run.loop.clock.sample == 2
    assert made.waiting.state[1].tolist() == made.state.ravel().tolist() and made.waiting.exact.tolist() == [
        0,
        1,
        0,
    ]
    assert not made.waiting.state[[0, 2]].any()
    made.mode.kind = mode.REGULAR
    made.waiting.exact[2] = 7
    samples.keep_sample(0.25, made)
    assert made.waiting.exact[2] == 0


def test_poses_are_affine_in_the_variables():
    constant, form = waves(24), np.where(waves(24, 3, seed=2.0) > 0.2, waves(24, 3, seed=3.0), 0.0)
    place, variable = np.nonzero(form)
    poses = SimpleNamespace(
        constant=constant,
        start=np.searchsorted(place, np.arange(25)),
        variable=variable,
        weight=form[place, variable],
    )
    made = memory(poses=poses)
    made.state[:, :3] = waves(3, 3, seed=4.0)
    samples.find_poses(made)
    expected = made.state[:, :3] @ form.T
    expected[0] += constant
    assert made.pose == pytest.approx(expected, abs=1e-15)


def turning() -> tuple[np.ndarray, ...]:
    """Return A, A' and A'' of a matrix that turns, with its angular velocity and acceleration in the body."""
    a = rotations.to_matrix(rotations.from_vector(np.array([0.4, -0.7, 1.1])))
    omega, rate = np.array([0.3, -0.5, 0.8]), np.array([-1.2, 0.6, 0.9])
    skew, more = (np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]) for w in (omega, rate))
    return a, a @ skew, a @ (skew @ skew + more), omega, rate


def test_states_of_bodies_from_their_poses():
    made, (a, first, second, omega, rate) = memory(), turning()
    made.pose[:] = waves(3, 24)
    for b, turned in enumerate((np.eye(3), np.diag([-1.0, -1.0, 1.0]))):
        for order, matrix in enumerate((a, first, second)):
            made.pose[order, 12 * b + 3 : 12 * b + 12] = (turned @ matrix).ravel()
    samples.put_state(made)
    state, acceleration = made.run.state, made.run.equations.system.acceleration
    for b, turned in enumerate((np.eye(3), np.diag([-1.0, -1.0, 1.0]))):
        q, v, w = state.coordinates[7 * b :], state.velocities[6 * b :], acceleration[6 * b :]
        assert q[:3].tolist() == made.pose[0, 12 * b : 12 * b + 3].tolist()
        assert v[:3].tolist() == made.pose[1, 12 * b : 12 * b + 3].tolist()
        assert w[:3].tolist() == made.pose[2, 12 * b : 12 * b + 3].tolist()
        assert rotations.to_matrix(q[3:7]) == pytest.approx(turned @ a, abs=1e-14) and q[3] >= 0.0
        assert v[3:6] == pytest.approx(omega, abs=1e-14) and w[3:6] == pytest.approx(rate, abs=1e-14)


@pytest.mark.parametrize("axis", range(4))
def test_quaternions_of_every_largest_entry(axis):
    """The entry that is the largest of the four; the sign is that of the quaternion before."""
    p = np.array([0.3, -0.2, 0.25, 0.1])
    p[axis] = 0.9
    p /= np.linalg.norm(p)
    for before in (p, -p):
        found = before + 0.05 * np.ones(4)
        samples.put_quaternion(rotations.to_matrix(p).ravel(), found)
        assert found == pytest.approx(before, abs=1e-15)


def test_a_quaternion_across_the_one_before_keeps_its_sign():
    found = np.array([0.0, 1.0, 0.0, 0.0])
    samples.put_quaternion(np.eye(3).ravel(), found)
    assert found.tolist() == [1.0, 0.0, 0.0, 0.0]


def test_states_where_a_series_begins_and_along_it(monkeypatch):
    made, calls = memory(), []
    monkeypatch.setattr(samples, "find_poses", lambda _: calls.append("poses"))
    monkeypatch.setattr(samples, "put_state", lambda _: calls.append("state"))
    samples.put_terms(made.series.terms, made)
    assert made.state[:2, :3].tolist() == made.series.terms[:2, :3].tolist() and calls == ["poses", "state"]
    assert (made.state[:, 3:] == 9.0).all() and (made.state[2] == 9.0).all()
    samples.put_state_at(0.2, made)
    value = np.polynomial.Polynomial(made.series.past[:5, 15])(0.2)
    assert made.state[0, 15] == pytest.approx(value) and calls == ["poses", "state"] * 2


# --- variables of states ------------------------------------------------------------------------------------
def test_values_and_rates_of_variables(monkeypatch):
    """Forms of 12 numbers of a moving body; a driver turns the second variable by 0.4 rad at 1.5 rad/s."""
    a, first, _, omega, _ = turning()
    position, velocity = waves(2, 3, seed=1.0), waves(2, 3, seed=2.0)
    frames = SimpleNamespace(
        position=position,
        velocity=velocity,
        rotation=np.stack([np.eye(3).ravel(), a.ravel()]),
        angular_velocity=np.stack([np.zeros(3), omega]),
    )
    made = memory()
    made.run.equations.frames = frames
    made.pose_maps = SimpleNamespace(
        body=np.array([1, 1, 0]),
        driver=np.array([-1, 0, -1]),
        along=waves(3, 12),
        across=waves(3, 12, seed=5.0),
    )
    asked: list[Any] = []
    monkeypatch.setattr(pose_maps, "set_poses", lambda *found: asked.append(found))
    monkeypatch.setattr(pose_maps, "set_velocities", lambda *found: asked.append(found))
    monkeypatch.setattr(pose_maps, "function_value", lambda k, t, _: (0.3 + 0.1 * k + 0.075 * t, 1.5, 9.0))
    pose_maps.read_variables(4 / 3, made)
    state = made.run.state
    assert [
        (one is mine, other is frames)
        for (one, other), mine in zip(asked, (state.coordinates, state.velocities), strict=True)
    ] == [(True, True)] * 2
    value, rate = (
        [np.append(x[1], m.ravel()), np.append(x[0], n)]
        for x, m, n in ((position, a, np.eye(3).ravel()), (velocity, first, np.zeros(9)))
    )
    along, across = made.pose_maps.along, made.pose_maps.across
    c, s = math.cos(0.4), math.sin(0.4)
    expected = [along[0] @ value[0], c * along[1] @ value[0] - s * across[1] @ value[0], along[2] @ value[1]]
    rates = [
        along[0] @ rate[0],
        (c * along[1] - s * across[1]) @ rate[0] - 1.5 * (s * along[1] + c * across[1]) @ value[0],
        along[2] @ rate[1],
    ]
    terms = made.series.terms
    assert terms[0, :3] == pytest.approx(expected, abs=1e-14) and terms[1, :3] == pytest.approx(
        rates, abs=1e-14
    )
    assert not terms[:2, 3:].any() and terms[2].all()


# --- saved series -------------------------------------------------------------------------------------------
def test_saved_variables_are_restored():
    saved = SimpleNamespace(terms=np.zeros((2, 4)), angles=np.zeros(2))
    series, angles = waves(4, 4), waves(2)
    saved_state.save_variables(series, angles, saved)
    assert saved.terms.tolist() == series[:2].tolist() and saved.angles.tolist() == angles.tolist()
    other, turned = np.zeros((4, 4)), np.zeros(2)
    saved_state.restore_variables(saved, other, turned)
    assert other[:2].tolist() == series[:2].tolist() and not other[2:].any()
    assert turned.tolist() == angles.tolist()


def test_the_series_of_a_step_has_angles_without_a_last_order():
    made = memory()
    made.series.torsions = waves(loads.TORSION_SERIES, ORDER + 1, seed=2.0)
    before = made.series.past.copy()
    step_start.save_series(made)
    assert made.series.past[:4].tolist() == made.series.terms[:4].tolist()
    assert made.series.past[4:].tolist() == before[4:].tolist()
    assert made.series.past_angles[0, :3].tolist() == made.series.torsions[loads.TORSION, :3].tolist()
    assert made.series.past_angles[0, 3] == 0.0
    assert vars(made.step) == {"used_order": 3, "last_order": 3, "time_to_pole": 0.0}


def test_kinds_of_steps():
    made = memory()
    mode.set_regular(made)
    assert vars(made.mode) == {"kind": mode.REGULAR, "tolerance": 1e-6, "order": 8} and not mode.is_accurate(
        made
    )
    mode.set_high_accuracy(made)
    assert vars(made.mode) == {"kind": mode.HIGH_ACCURACY, "tolerance": 1e-13, "order": 22}
    assert mode.is_accurate(made)
    mode.set_predictor(made)
    assert vars(made.mode) == {"kind": mode.PREDICTOR, "tolerance": 1e-4, "order": 8}


@pytest.mark.parametrize(("second", "times"), [(-1.0, [1.6]), (0.0, [1.6, 1.5]), (0.3, [1.6, 1.8])])
def test_crossings_of_a_step_are_recorded(monkeypatch, second, times):
    """The step of 0.5 s ends at 2 s; the state is put at each distance from its start."""
    made = memory()
    made.step.first_crossing, made.step.second_crossing = 0.1, second
    made.progress = SimpleNamespace(recorded=1)
    made.crossings = SimpleNamespace(
        time=np.zeros(4), coordinates=np.zeros((4, 14)), velocities=np.zeros((4, 12))
    )

    def put(h: float, _: Any) -> None:
        made.run.state.coordinates[:], made.run.state.velocities[:] = h, -h

    monkeypatch.setattr(short_crossing, "put_state_at", put)
    assert short_crossing.record_crossings.function(made) == OK
    assert made.crossings.time.tolist() == pytest.approx([0.0, *times, *[0.0] * (3 - len(times))])
    assert made.progress.recorded == 1 + len(times)
    for k, time in enumerate(times, 1):
        assert made.crossings.coordinates[k] == pytest.approx([time - 1.5] * 14)
        assert made.crossings.velocities[k] == pytest.approx([1.5 - time] * 12)


def test_a_crossing_that_fails_restores_variables_and_angles():
    made = memory()
    made.step_start = SimpleNamespace(terms=waves(2, LANES, seed=7.0), angles=np.array([0.7]))
    short_crossing.restore_step_start(made)
    assert made.series.past[:2].tolist() == made.step_start.terms.tolist() and made.angles.tolist() == [0.7]
    assert made.run.equations.angles.tolist() == [0.0, 0.7]


# --- beginnings ---------------------------------------------------------------------------------------------
def starting(monkeypatch: pytest.MonkeyPatch, **kernels: Any) -> tuple[Any, list[Any]]:
    made, calls = memory(), []
    for name in ("select_pieces", "read_variables", "expand_functions"):
        monkeypatch.setattr(stepping, name, lambda t, _, name=name: calls.append((name, t)))
    made.kernels = SimpleNamespace(
        partition=lambda _: calls.append("partition"),
        expand=lambda t, _: calls.append(("expand", t)) or kernels.get("expand", OK),
        correct=lambda _: calls.append("correct") or kernels.get("correct", OK),
        terms=lambda _: calls.append("terms"),
        judge_start=lambda status, _: calls.append(("judge", status)) or 77,
    )
    made.progress = SimpleNamespace(leaving=1, rests_near=1)
    return made, calls


def test_a_series_begins_with_a_partition(monkeypatch):
    """Later than t = 0 no start is judged."""
    made, calls = starting(monkeypatch)
    made.run.equations.angles[1] = 0.4
    assert stepping.begin_series.function(made) == OK and made.angles.tolist() == [0.4]
    names = ("select_pieces", "read_variables", "expand_functions")
    assert calls == [*((name, 2.0) for name in names), "partition", ("expand", 2.0)]
    assert made.step.crossed == made.progress.leaving == made.progress.rests_near == 0


@pytest.mark.parametrize("status", [OK, NOT_CONVERGED])
def test_a_start_is_judged(monkeypatch, status):
    made, calls = starting(monkeypatch, expand=status)
    made.run.loop.clock.time = 0.0
    assert stepping.begin_series.function(made) == 77 and calls[-1] == ("judge", status)


def test_only_a_corrected_state_is_expanded(monkeypatch):
    """Functions are expanded about the time, by their pieces at the clock."""
    made, calls = starting(monkeypatch)
    assert stepping.expand_from.function(2.3, made) == OK
    assert calls == [("select_pieces", 2.0), ("expand_functions", 2.3), "correct", "terms"]
    made, calls = starting(monkeypatch, correct=NOT_CONVERGED)
    assert stepping.expand_from.function(2.3, made) == NOT_CONVERGED and "terms" not in calls


def test_the_pivot_where_a_motion_turns_back(monkeypatch):
    """A motion that turns back at 0.3 s of a step of 1 s, where G is [[0, 2], [0.5, 1]] times the time."""
    made, times = memory(), []

    def evaluate(h: float, _: Any) -> None:
        times.append(h)
        made.state[0, 0] = h

    made.solver.work, made.partition = np.zeros((2, 2)), SimpleNamespace(rank=2)
    made.solver.pivot_rows, made.solver.pivot_columns = np.array([1, 0]), np.array([1, 0])
    gradient = np.array([[0.5, 2.0], [0.6, 1.0]])
    made.kernels = SimpleNamespace(
        gradient=lambda y, m: m.solver.work.__setitem__(slice(None), gradient * y[0, 0])
    )
    monkeypatch.setattr(acceptance, "evaluate_series", evaluate)
    monkeypatch.setattr(acceptance, "turns_back", lambda state, _: state[0, 0] >= 0.3)
    # rows in the order 1, 0: the pivots are 1 and 0.5 - 2 · 0.6, times 0.3
    assert acceptance.pivot_at_turning_point.function(1.0, made) == pytest.approx(0.3 * 0.7)
    assert times[0] == 0.5 and times[-1] == 1.0 and len(times) == acceptance.BISECTIONS + 1
    made.partition.rank = 1
    assert acceptance.pivot_at_turning_point.function(1.0, made) == pytest.approx(0.3)


# --- determinants inside a step -----------------------------------------------------------------------------
def inside(patch: pytest.MonkeyPatch, at: dict[float, float]) -> tuple[Any, list[Any]]:
    """A step of 2 s, whose determinants at the ends have the logarithms 3 and 5, and ``at`` other times."""
    made, calls = memory(), []
    patch.setattr(detection, "end_logarithms", lambda _: (3.0, 5.0))
    patch.setattr(detection, "logarithm_at", lambda h, _: at[round(h, 6)])
    patch.setattr(detection, "time_of_minimum", lambda h, sections, _: h * sections)
    patch.setattr(detection, "evaluate_series", lambda h, _: calls.append(h))
    made.step.start_pivot, made.progress = 0.4, SimpleNamespace(largest_pivot=0.5)
    return made, calls


COARSE, FINE = 2.0 * detection.SECTIONS_COARSE, 2.0 * detection.SECTIONS


@pytest.mark.parametrize(
    ("level", "coarse", "fine", "vanishes"),
    [
        (False, 0.99, -27.01, True),
        (False, 0.99, -26.99, False),
        (False, 1.01, -99.0, False),
        (True, 0.99, -27.01, False),
    ],
)
def test_a_determinant_that_vanishes_inside_a_step(monkeypatch, level, coarse, fine, vanishes):
    """Relative to the smaller end, exp(-2) at first and exp(-30) after a finer search."""
    made, calls = inside(monkeypatch, {COARSE: coarse, FINE: fine})
    asked: list[Any] = []
    monkeypatch.setattr(detection, "stays_level", lambda h, largest, _: asked.append((h, largest)) or level)
    assert detection.vanishes_inside(2.0, made) is vanishes and asked == [(2.0, 5.0)] and calls == [2.0]


@pytest.mark.parametrize(
    ("first", "second", "level"), [(4.4, 4.4, True), (4.2, 4.4, False), (4.4, 4.2, False)]
)
def test_a_determinant_that_stays_level(monkeypatch, first, second, level):
    """More than half of the larger end, exp(5), at both golden sections."""
    made, _ = inside(monkeypatch, {0.763932: first, 1.236068: second})
    assert detection.stays_level(2.0, 5.0, made) is level


@pytest.mark.parametrize(
    ("dip", "lowest", "accurate", "vanishes"),
    [
        (1.38, 0.0, False, True),
        (1.4, 0.0, False, False),
        (1.38, -27.01, True, True),
        (1.38, -26.99, True, False),
        (1.4, -27.01, True, False),
    ],
)
def test_a_determinant_that_dips_where_the_pivot_vanishes(monkeypatch, dip, lowest, accurate, vanishes):
    """0.4 falls to zero at 1.6 s on the way to -0.1; 0.2 of the smaller end is exp(3) / 5."""
    made, calls = inside(monkeypatch, {1.6: dip, FINE: lowest})
    made.mode.kind = mode.HIGH_ACCURACY if accurate else mode.REGULAR
    assert bool(detection.dips_to_zero(2.0, 0.1, made)) is vanishes and calls == [2.0]


def test_a_high_accuracy_step_that_starts_near_needs_no_minimum(monkeypatch):
    """0.6 of the largest pivot is far."""
    made, _ = inside(monkeypatch, {1.6: 1.38, FINE: 0.0})
    made.progress.largest_pivot = 0.67
    assert detection.dips_to_zero(2.0, 0.1, made)
    made.progress.largest_pivot = 0.66
    assert not detection.dips_to_zero(2.0, 0.1, made)


def changing(
    patch: pytest.MonkeyPatch, signs: list[bool], free: int = 2, **answers: Any
) -> tuple[Any, list[Any]]:
    """A step of 3 s whose determinants have these signs one after the other."""
    made, calls, left = memory(), [], list(signs)

    def determinant(y: Any, _: Any) -> tuple[bool, float]:
        calls.append("state" if y is made.state else "terms" if y is made.series.terms else y)
        return left.pop(0), 0.0

    made.kernels = SimpleNamespace(determinant=determinant)
    patch.setattr(detection, "freedoms", lambda _: free)
    patch.setattr(detection, "has_one_null_vector", lambda _: free == 1)
    patch.setattr(detection, "save_start_determinant", lambda _: calls.append("start"))
    patch.setattr(detection, "save_gradient", lambda _: calls.append("gradient"))
    patch.setattr(detection, "evaluate_series", lambda h, _: calls.append(h))
    patch.setattr(
        detection, "gradient_determinant_at_end", lambda _: calls.append("end") or (left.pop(0), 0.0)
    )
    for name in ("null_vectors_oppose", "rates_oppose", "is_undriven", "turns_back"):
        patch.setattr(detection, name, lambda *_, name=name: answers.get(name, False))
    return made, calls


@pytest.mark.parametrize(
    ("signs", "changes"),
    [
        ([False, False, False], False),
        ([True, False, False], True),
        ([False, True, True], True),
        ([False, False, True], True),
    ],
)
def test_a_long_step_is_judged_in_parts(monkeypatch, signs, changes):
    """Three parts of 1 s: each with the gradient of the one before; the state at the end is put back."""
    made, calls = changing(monkeypatch, signs)
    assert detection.determinant_changes_sign(3.0, 3, made) is changes
    part = ["state", "gradient"]
    assert calls == ["start", 1.0, *part, 2.0, *part, "terms", 3.0]
    square, calls = changing(monkeypatch, signs, free=0)
    assert detection.determinant_changes_sign(3.0, 3, square) is changes
    assert calls == ["start", 1.0, "state", 2.0, "state", "end", 3.0]


def test_a_step_in_one_part(monkeypatch):
    for sign in (True, False):
        made, calls = changing(monkeypatch, [sign])
        assert detection.determinant_changes_sign(3.0, 1, made) is sign and calls == ["start", "terms"]
        one, calls = changing(monkeypatch, [], free=1, null_vectors_oppose=sign)
        assert detection.determinant_changes_sign(3.0, 1, one) is sign and not calls


@pytest.mark.parametrize(
    ("parts", "undriven", "turned", "by_rates"),
    [
        (2, True, False, True),
        (4, True, False, True),
        (5, True, False, False),
        (2, False, False, False),
        (2, True, True, False),
    ],
)
def test_a_few_parts_of_one_freedom_are_judged_by_their_rates(monkeypatch, parts, undriven, turned, by_rates):
    """Up to four parts of a motion without drivers that does not turn back."""
    made, calls = changing(
        monkeypatch, [False] * parts, free=1, is_undriven=undriven, turns_back=turned, rates_oppose=True
    )
    assert detection.determinant_changes_sign(3.0, parts, made) is by_rates and bool(calls) is not by_rates
