"""Branches at a singular position: lines, forms and velocities worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.equations import branches as b
from mbref.equations.branches import Branches, Fit, Passed, SecondOrder
from mbref.input_error import InputError


def lines(found: list[np.ndarray]) -> list[tuple[float, ...]]:
    """Return lines as unit vectors whose last component that is not zero is positive, in order."""
    signed = [a * np.sign(a[np.flatnonzero(np.abs(a) > 1e-9)[-1]]) for a in found]
    return sorted(tuple((a / np.linalg.norm(a)).round(9) + 0.0) for a in signed)


def unit(*numbers: float) -> tuple[float, ...]:
    return tuple((np.array(numbers) / np.linalg.norm(numbers)).round(9))


# --- forms of two and three variables ---------------------------------------------------------------------
@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ([[1, 0], [0, -4]], [(-2, 1), (2, 1)]),
        ([[4, 0], [0, -1]], [(-1, 2), (1, 2)]),
        ([[3, 2.5], [2.5, -2]], [(-2, 1), (1, 3)]),  # (x + 2 y) (3 x - y)
        ([[1, 0], [0, 0]], [(0, 1)]),
        ([[-1, 0], [0, 0]], [(0, 1)]),
        ([[4, -2], [-2, 1]], [(1, 2)]),  # (2 x - y)²
        ([[1, 0], [0, 2]], []),
        ([[-1, 0], [0, -2]], []),
    ],
)
def test_lines_of_a_form_of_two_variables(form, expected):
    assert lines(b._roots(np.array(form, dtype=float))) == [unit(*line) for line in expected]


def test_values_of_forms():
    forms = np.array([[[1.0, 2.0], [2.0, 5.0]], [[0.0, -1.0], [-1.0, 3.0]]])
    assert b._values(forms, np.array([2.0, 3.0])).tolist() == [4 + 24 + 45, -12 + 27]


def test_angles_between_lines():
    one, tilted = np.array([1.0, 0.0]), np.array([-0.6, 0.8])
    assert b._angle(one, -one) == b._angle(one * (1 + 1e-12), one) == 0.0
    assert b._angle(one, tilted) == pytest.approx(math.acos(0.6))


def test_forms_that_have_equal_zeros_count_once():
    first, second = np.array([[1.0, 2.0], [2.0, -3.0]]), np.array([[0.0, 1.0], [1.0, 0.5]])
    assert b._independent(np.zeros((0, 3, 3))).shape == (0, 3, 3)
    assert b._independent(np.zeros((2, 2, 2))).shape == (0, 2, 2)
    found = b._independent(np.array([first, -2 * first]))
    assert np.abs(found) == pytest.approx(np.abs(first)[None] / math.sqrt(18))
    both = b._independent(np.array([first, second, first + second]))
    assert both.shape == (2, 2, 2)
    span = np.array([first.ravel(), second.ravel()])
    assert np.linalg.matrix_rank(np.vstack([span, both.reshape(2, 4)])) == 2
    assert len(b._independent(np.array([1e9 * first, second]))) == 1, "relative to large forms"


@pytest.fixture
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin Newton's method 25 times: enough for four lines."""
    monkeypatch.setattr(b, "ROOT_STARTS", 25)


@pytest.mark.usefixtures("few_starts")
def test_lines_of_several_forms():
    """Four lines: x² = z² and y² = 4 z². Two double lines: x² = 0 and y² = z². A plane: x z = y z = 0."""
    x, y, z = np.eye(3)
    square = lambda a: np.outer(a, a)  # noqa: E731
    mixed = lambda a, c: (np.outer(a, c) + np.outer(c, a)) / 2  # noqa: E731
    four = np.array([square(x) - square(z), square(y) - 4 * square(z)])
    found, multiple = b._roots_of_many(four)
    assert lines(found) == sorted(unit(i, 2 * j, 1) for i in (-1, 1) for j in (-1, 1)) and not multiple
    found, multiple = b._roots_of_many(np.array([square(x), square(y) - square(z)]))
    assert found == [] and multiple
    assert b._roots_of_many(np.array([mixed(x, z), mixed(y, z)])) is None
    assert b._roots_of_many(four[:1]) is None, "one form of three variables has a cone"


def test_the_end_of_newtons_method():
    forms = np.array([[[1.0, 0.0], [0.0, -4.0]]])
    a, left, is_simple = b._root_from(forms, np.array([5.0, 1.0]))
    assert lines([a]) == [unit(2, 1)] and left < 1e-15 and is_simple
    a, left, is_simple = b._root_from(np.array([[[1.0, 0.0], [0.0, 0.0]]]), np.array([1.0, 1.0]))
    assert left < 1e-12 and not is_simple
    assert b._root_from(np.array([[[1.0, 0.0], [0.0, 1.0]]]), np.array([3.0, 4.0]))[1] > 0.9
    assert b._root_from(np.array([np.zeros((2, 2)), np.eye(2)]), np.array([3.0, 4.0]))[1] > 0.9


def test_a_form_at_the_limit_has_a_line(monkeypatch):
    monkeypatch.setattr(b, "SAME", 2.0**-13)
    assert len(b._roots(np.diag([2.0**-13, 2.0**-13]))) == 1
    assert b._roots(np.diag([2.0**-13, 1.01 * 2.0**-13])) == []


# --- second order -----------------------------------------------------------------------------------------
LENGTHS = np.array([0.5, 4.0])
CONSTANT, LINEAR = np.array([3.0, -2.0, 0.5]), np.arange(36.0).reshape(3, 12) / 7 - 2
QUADRATIC = np.sin(np.arange(3 * 144.0)).reshape(3, 12, 12)
QUADRATIC = QUADRATIC + QUADRATIC.transpose(0, 2, 1)
Q = np.arange(14.0)


class Curved:
    """A model of two bodies and three rows, with γ of second degree in the velocities."""

    nb, n, m = 2, 12, 3
    data = SimpleNamespace(lengths=LENGTHS)
    mass = np.arange(1.0, 13.0)

    def __init__(self, jacobian: np.ndarray, nu: float = 0.0, curved: float = 1.0, moving: float = 0.0):
        self.jacobian, self.nu, self.curved, self.moving = jacobian, np.full(3, nu), curved, moving

    def terms(self, t: Any, q: np.ndarray, v: np.ndarray | None = None) -> Any:
        assert np.all(np.asarray(t) == 0.25) and np.all(q == Q)
        v = np.zeros(12) if v is None else v
        gamma = self.curved * np.einsum("kij,...i,...j->...k", QUADRATIC, v, v)
        gamma = gamma + self.moving * (v @ LINEAR.T + CONSTANT)
        return SimpleNamespace(jacobian=self.jacobian, nu=self.nu, gamma=gamma)


def test_second_order_terms_along_directions():
    directions = np.cos(np.arange(26.0)).reshape(2, 13)
    found = b._rates(Curved(np.zeros((3, 12)), moving=1.0), 0.25, Q, directions)
    for (*v, time), row in zip(directions, found, strict=True):
        expected = np.einsum("kij,i,j->k", QUADRATIC, v, v) + time * (LINEAR @ v) + time**2 * CONSTANT
        assert row == pytest.approx(expected)


def test_forms_of_left_null_vectors():
    directions = np.cos(np.arange(39.0)).reshape(13, 3)
    null = np.array([[1.0, 2.0, -0.5], [0.0, 3.0, 1.0]])
    whole = np.zeros((3, 13, 13))
    whole[:, :12, :12], whole[:, 12, 12] = QUADRATIC, CONSTANT
    whole[:, 12, :12] = whole[:, :12, 12] = LINEAR / 2
    found = b._forms(Curved(np.zeros((3, 12)), moving=1.0), 0.25, Q, directions, null)
    assert found == pytest.approx(np.einsum("ck,kij,ia,jb->cab", null, whole, directions, directions))


def rows(*entries: tuple[int, float]) -> np.ndarray:
    """Return three rows with one entry each: column and value."""
    found = np.zeros((3, 12))
    for row, (column, value) in enumerate(entries):
        found[row, column] = value
    return found


def test_directions_and_forms_without_drivers():
    """Rows 0 and 1 forbid the same velocity x of the first body, row 2 the turn about x of the second."""
    found = b.second_order(Curved(rows((0, 2.0), (0, 5.0), (9, 3.0))), 0.25, Q, np.ones(12))
    assert found.scale.tolist() == [1, 1, 1, 2, 2, 2, 1, 1, 1, 0.25, 0.25, 0.25, 0]
    assert found.kernel.shape == (13, 10) and np.abs(found.kernel[[0, 9, 12]]).max() < 1e-12
    assert found.kernel.T @ found.kernel == pytest.approx(np.eye(10))
    along = found.kernel * found.scale[:, None]
    expected = along[:12].T @ (QUADRATIC[0] / 2 - QUADRATIC[1] / 5) @ along[:12]
    [form] = found.forms
    assert form / form[0, 0] == pytest.approx(expected / expected[0, 0]) and np.linalg.norm(form) == 1.0


def test_rows_have_unit_length_whatever_the_sizes_of_bodies_are():
    """Bodies of 0.1 mm and 10 km: a row for each turn, and one for a displacement, are independent."""
    made = Curved(rows((0, 2.0), (3, 1.0), (9, 1.0)))
    made.data = SimpleNamespace(lengths=np.array([1e-4, 1e4]))
    found = b.second_order(made, 0.25, Q, np.ones(12))
    assert found.kernel.shape == (13, 9) and found.forms.shape == (0, 9, 9)


@pytest.mark.parametrize(("v", "time"), [(np.arange(12.0), None), (np.zeros(12), 1.0)])
def test_time_is_scaled_by_the_velocities(v, time):
    """Lengths over displacements are 0.5 m and 4 m; ν = 6 moves the first body by 3 m/s along x."""
    found = b.second_order(Curved(rows((0, 2.0), (0, 2.0), (9, 3.0)), nu=6.0), 0.25, Q, v)
    if time is None:
        squares = [1, 4, *(0.25 * k * k for k in (3, 4, 5)), 36, 49, 64, *(16 * k * k for k in (9, 10, 11))]
        time = 1 / math.sqrt(sum(squares))
    assert found.scale[-1] == pytest.approx(time)
    u = found.kernel * found.scale[:, None]
    assert u[0] == pytest.approx(3.0 * u[-1]) and u[9] == pytest.approx(2.0 * u[-1])
    assert found.kernel.shape == (13, 11) and np.abs(u[-1]).max() > 0.0
    moving = b.second_order(Curved(rows((0, 2.0), (0, 2.0), (9, 3.0)), moving=1.0), 0.25, Q, v)
    assert moving.scale[-1] == pytest.approx(time), "γ at rest depends on time, too"


@pytest.mark.parametrize(
    ("nu", "gamma", "driven"),
    [((0, 6, 0), (0,) * 3, True), ((0,) * 3, (0, 0, 5), True), ((0,) * 3, (0,) * 3, False)],
)
def test_time_counts_where_one_row_depends_on_it(nu, gamma, driven):
    made = Curved(rows((0, 2.0), (1, 2.0), (9, 3.0)), curved=0.0)
    made.nu = np.array(nu, dtype=float)
    terms = made.terms

    def with_time(t: Any, q: np.ndarray, v: np.ndarray | None = None) -> Any:
        found = terms(t, q, v)
        return SimpleNamespace(
            jacobian=found.jacobian, nu=found.nu, gamma=found.gamma + np.array(gamma, float)
        )

    made.terms = with_time  # type: ignore[method-assign]
    found = b.second_order(made, 0.25, Q, np.zeros(12))
    assert found.scale[-1] == (1.0 if driven else 0.0) and found.kernel.shape == (13, 10 if driven else 9)


# --- directions and velocities ----------------------------------------------------------------------------
KERNEL = np.linalg.qr(np.cos(np.arange(9.0).reshape(3, 3) ** 2))[0][:, :2]
MODEL: Any = SimpleNamespace(mass=np.array([2.0, 5.0]), n=2, m=3)


def order(forms: Any, time: float = 0.0, kernel: np.ndarray | None = None) -> SecondOrder:
    kernel = KERNEL if kernel is None else kernel
    d = kernel.shape[1]
    return SecondOrder(kernel, np.array(forms, dtype=float).reshape(-1, d, d), np.array([0.5, 4.0, time]))


def test_the_direction_of_velocities():
    """A velocity over its scale, in the kernel's directions, of unit length; time passes at the rate 1."""
    v = np.array([3.0, 8.0])
    for time, whole in ((0.0, [6.0, 2.0, 0.0]), (0.25, [6.0, 2.0, 4.0])):
        expected = KERNEL.T @ np.array(whole)
        found = b._direction(order([], time), v)
        assert found == pytest.approx(expected / np.linalg.norm(expected))
    assert b._direction(order([]), np.zeros(2)).tolist() == [0.0, 0.0]


def test_velocities_of_a_branch_without_drivers_have_the_energy_of_the_motion():
    found, a = order([], kernel=np.eye(3)[:, :2]), np.array([0.6, 0.8])
    along = np.array([0.3, 3.2])
    for v in (np.array([1.0, 2.0]), np.array([-1.0, -2.0])):
        w = b._velocity(MODEL, found, a, v)
        assert w == pytest.approx(v[0] * along * math.sqrt(22 / (2 * 0.09 + 5 * 3.2**2)))
    across = np.array([-5 * 3.2, 2 * 0.3])  # the momenta along the branch are zero
    assert b._velocity(MODEL, found, a, across)[0] > 0.0


def test_velocities_of_a_branch_with_drivers_are_rates(monkeypatch):
    found = order([], 0.25, np.eye(3))
    assert b._velocity(MODEL, found, np.array([1.0, 2.0, 4.0]), np.zeros(2)) == pytest.approx([0.5, 8.0])
    assert b._velocity(MODEL, found, np.array([1.0, 2.0, -4.0]), np.zeros(2)) == pytest.approx([-0.5, -8.0])
    assert b._velocity(MODEL, found, np.array([1.0, 2.0, 1e-4]), np.zeros(2)) is None
    monkeypatch.setattr(b, "SAME", 2.0**-30)  # |u| is 1: the rate of time is at the limit, and above
    assert b._velocity(MODEL, found, np.array([2.0, 0.0, 2.0**-28]), np.zeros(2)) is None
    assert b._velocity(MODEL, found, np.array([2.0, 0.0, 2.0**-27]), np.zeros(2)) == pytest.approx(
        [2.0**29, 0.0]
    )


def test_directions_that_agree_with_given_velocities(monkeypatch):
    given, v = np.array([True, False, True]), np.array([2.0, 0.0, 6.0])
    assert b._as_given(np.array([1.0, 7.0, 3.0, 0.5]), v, given) == pytest.approx([2, 14, 6])
    assert b._as_given(np.array([1.0, 7.0, 3.0, 0.4]), v, given) is None
    assert b._as_given(np.array([-1.0, 7.0, -3.0, 0.0]), v, given) == pytest.approx([2, -14, 6])
    u, all_given = np.array([1.0, 2.0**-30]), np.array([True])
    monkeypatch.setattr(b, "SAME", 2.0**-30)  # |u| is 1: the rate of time is at the limit
    assert b._as_given(u, np.array([2.0]), all_given) == pytest.approx([2.0])
    monkeypatch.undo()
    assert b._as_given(np.array([1.0, 7.0, 3.1, 0.0]), v, given) is None
    free = np.zeros(3, dtype=bool)
    assert b._as_given(np.array([1.0, 7.0, 3.0, 0.0]), v, free) == pytest.approx([1, 7, 3])
    assert b._as_given(np.array([1e-5, 7.0, 3e-5, 0.0]), v, given) is None, "it hardly moves what is given"


@pytest.fixture
def set_order(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Let ``second_order`` give a result for MODEL at Q."""

    def put(found: SecondOrder) -> None:
        def second(model: Any, t: float, q: np.ndarray, v: np.ndarray) -> SecondOrder:
            assert model is MODEL and t == 0.0 and q is Q and v.shape == (2,)
            return found

        monkeypatch.setattr(b, "second_order", second)

    return put


PLANE = np.eye(3)[:, :2]
CROSS = [[1.0, 0.0], [0.0, -1.0]]  # along x = ± y of the kernel: velocities (0.5, ± 4)


def test_velocities_along_branches_with_the_least_energy_first(set_order):
    """The velocity x is given as 1 m/s; y is -4 or 24 m/s, or 8 / 3 and -16 m/s."""
    given, v = np.array([True, False]), np.array([1.0, 0.0])
    set_order(order([[[3.0, 2.5], [2.5, -2.0]]], kernel=PLANE))  # along (-2, 1) and (1, 3)
    first, second = b.velocities_along(MODEL, Q, v, given)
    assert first == pytest.approx([1.0, -4.0]) and second == pytest.approx([1.0, 24.0])
    set_order(order([[[-2.0, 2.5], [2.5, 3.0]]], kernel=PLANE))  # along (1, -2) and (3, 1)
    first, second = b.velocities_along(MODEL, Q, v, given)
    assert first == pytest.approx([1.0, 8 / 3]) and second == pytest.approx([1.0, -16.0])
    assert b.velocities_along(MODEL, Q, np.array([1.0, -16.0]), given) == [], "it is along a branch"
    set_order(order([], kernel=PLANE))
    assert b.velocities_along(MODEL, Q, v, given) == []
    set_order(order([[[-2.0, 2.5], [2.5, 3.0]]], kernel=PLANE))
    assert lines(list(b.tangents(MODEL, Q))) == sorted([unit(1.5, 4.0), unit(-0.5, 8.0)])
    set_order(order([], kernel=PLANE))
    assert b.tangents(MODEL, Q).shape == (0, 2)


def test_how_velocities_fit_branches(set_order):
    set_order(order([CROSS], kernel=PLANE))
    assert b.fit_to_branches(MODEL, 0.0, Q, np.array([0.5, 4.0])) == Fit(True, True)
    assert b.fit_to_branches(MODEL, 0.0, Q, np.array([0.5, 3.0])) == Fit(False, True)
    set_order(order([[[1.0, 0.0], [0.0, 0.0]]], kernel=PLANE))
    assert b.fit_to_branches(MODEL, 0.0, Q, np.array([0.0, 4.0])) == Fit(True, False)
    set_order(order([CROSS, [[1, 0.5], [0.5, -2]]], kernel=PLANE))  # (x + y) (x - y) and (x - y) (x + 2 y)
    assert b.fit_to_branches(MODEL, 0.0, Q, np.array([0.5, 4.0])) == Fit(True, True)
    assert b.fit_to_branches(MODEL, 0.0, Q, np.array([0.5, -4.0])) == Fit(False, False)
    for value, fits in ((b.SAME, False), (math.nextafter(b.SAME, 0.0), True)):
        form = order([[[value, 0.0], [0.0, -1.0]]], kernel=PLANE)
        assert b._fits(form, np.array([1.0, 0.0])) is fits
    for regular in (order([], kernel=PLANE), order([[[1.0]]], kernel=PLANE[:, :1])):
        set_order(regular)
        assert b.fit_to_branches(MODEL, 0.0, Q, np.array([0.5, 4.0])) is None


@pytest.mark.usefixtures("few_starts")
@pytest.mark.parametrize(
    ("found", "v", "others", "sentence"),
    [
        (order([[[1.0]]], kernel=PLANE[:, :1]), (1, 0), [], b.NO_OTHER),
        (order([], kernel=PLANE), (1, 0), [], b.ALL_AGREE),
        (order([CROSS], kernel=PLANE), (0.5, 4), [(0.5, -4)], "2 branches"),
        (order([CROSS], kernel=PLANE), (0.5, -4), [(0.5, 4)], "2 branches"),
        (order([[[1.0, 0.0], [0.0, 0.0]]], kernel=PLANE), (0, 4), [], b.TANGENT),
        (order([[[1, 0], [0, 1]]], kernel=PLANE), (0, 4), [], b.ALONE),
        (order([np.diag([1.0, 1.0, -1.0])], 1.0, np.eye(3)), (0.5, 0), [], b.CONE),
        (
            order([np.diag([1.0, 0, -1]), np.diag([0, 1.0, 0])], 1, np.eye(3)),
            (0.5, 0),
            [],
            b.ALONE + b.MULTIPLE,
        ),
    ],
    ids=["regular", "all", "cross", "other side", "tangent", "no line", "cone", "multiple"],
)
def test_branches_and_their_sentence(set_order, found, v, others, sentence):
    set_order(found)
    velocities, said = b.branches(MODEL, 0.0, Q, np.array(v, dtype=float))
    assert said == sentence
    size = lambda w: math.sqrt(2 * w[0] ** 2 + 5 * w[1] ** 2)  # noqa: E731
    assert velocities[0].tolist() == list(v)
    assert len(velocities) == 1 + len(others)
    for other, expected in zip(velocities[1:], others, strict=True):
        sign = 1.0 if np.dot(MODEL.mass * v, expected) >= 0 else -1.0
        assert other == pytest.approx(sign * np.array(expected) * size(v) / size(expected))


@pytest.mark.parametrize(
    ("forms", "count", "sentence"),
    [
        ([CROSS], 2, "2 branches"),
        ([[[1, 0], [0, 1]]], 1, b.ALONE),
        ([CROSS, [[1, 0.5], [0.5, -2]]], 1, b.ALONE),  # (x + y) (x - y) and (x - y) (x + 2 y)
    ],
)
def test_branches_of_a_scene_at_rest(set_order, forms, count, sentence):
    """All branches have the velocity zero."""
    set_order(order(forms, kernel=PLANE))
    velocities, said = b.branches(MODEL, 0.0, Q, np.zeros(2))
    assert velocities.tolist() == [[0.0, 0.0]] * count and said == sentence


@pytest.mark.parametrize(("angle", "count"), [(b.SAME, 1), (math.nextafter(b.SAME, 1.0), 3)])
def test_directions_at_a_small_angle_to_the_motion_are_its_branch(monkeypatch, set_order, angle, count):
    set_order(order([CROSS], kernel=PLANE))
    asked: list[Any] = []
    monkeypatch.setattr(b, "_lines", lambda found: ([np.array([0.6, 0.8]), np.array([0.8, 0.6])], ""))
    monkeypatch.setattr(b, "_angle", lambda *lines: asked.append(lines) or angle)
    velocities, said = b.branches(MODEL, 0.0, Q, np.array([0.5, 4.0]))
    assert len(velocities) == count and said == (b.ALONE if count == 1 else "3 branches")
    assert asked[0][0].tolist() == [0.6, 0.8] and asked[0][1] == pytest.approx([math.sqrt(0.5)] * 2)


@pytest.mark.parametrize(("size", "is_simple"), [(0.45, False), (0.55, True)])
def test_a_direction_is_simple_where_the_rate_of_its_form_exceeds_the_limit(set_order, size, is_simple):
    """The rate of the form s x² along x = 1 is 2 s."""
    found = order([[[size * b.SAME, 0.0], [0.0, 0.0]]], kernel=PLANE)
    set_order(found)
    assert b.fit_to_branches(MODEL, 0.0, Q, np.array([0.5, 0.0])) == Fit(True, is_simple)
    assert b._root_from(found.forms * 0.0, np.array([3.0, 0.0]))[1:] == (0.0, False)


@pytest.mark.parametrize(("size", "is_simple"), [(0.45, False), (0.55, True)])
def test_a_root_is_simple_where_the_rates_of_its_forms_exceed_the_limit(monkeypatch, size, is_simple):
    """The rate of the form 2 s x y at x = 1 is 2 s along y."""
    monkeypatch.setattr(b, "ROOT_ITERATIONS", 1)
    form = np.array([[[0.0, size * b.SAME], [size * b.SAME, 0.0]]])
    a, left, found = b._root_from(form, np.array([3.0, 0.0]))
    assert a == pytest.approx([1.0, 0.0]) and left <= 1e-12 and found is is_simple


def test_the_branches_of_a_crossing_that_was_passed(monkeypatch):
    v, asked = np.array([1.0, 2.0]), []
    both = Branches(np.array([v, -v]), "2 branches")
    monkeypatch.setattr(b, "branches", lambda *given: asked.append(given) or both)
    model: Any = SimpleNamespace(m=b.MOST_BRANCHED_ROWS)
    assert b.branches_passed(model, Passed(0.75, Q, v, 2)) is both
    assert asked[0][1] == 0.75 and asked[0][2] is Q and asked[0][3] is v
    with pytest.raises(InputError, match=r"branches: the crossing at t = 0.75 s has no branch 3: 2 branches"):
        b.branches_passed(model, Passed(0.75, Q, v, 3))
    model.m += 1
    found = b.branches_passed(model, Passed(0.75, Q, v, 1))
    assert found.velocities.tolist() == [[1.0, 2.0]] and found.sentence == b.NOT_LOOKED_FOR
    assert len(asked) == 2
