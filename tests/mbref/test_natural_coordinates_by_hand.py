"""Natural coordinates / expressions, eliminations, forms and orientations of bodies, worked out by hand."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import rotations
from mbref.kernels.scene_layout import ABOUT_AXIS, ALONG_AXIS, FORCE, MOMENT, SPRING
from mbref.taylor import expressions, load_polynomials, numbers, orientations, polynomials
from mbref.taylor.direction_vectors import NO_DRIVER, DirectionVectors, direction_forms
from mbref.taylor.expressions import ONE, Elimination, Polynomial
from mbref.taylor.forms import sum_of_products
from mbref.taylor.natural import unit_of_length
from mbref.taylor.orientations import FIXED, Orientation


# --- expressions --------------------------------------------------------------------------------------------
def test_sums_of_expressions_lose_what_cancels():
    found = expressions.combination((2.0, {ONE: 1.0, 0: 3.0}), (-1.0, {0: 6.0, 1: 4.0}), (1.0, {1: 1.0}))
    assert found == {ONE: 2.0, 1: -3.0}
    assert expressions.combination((0.1, {0: 1.0}), (0.2, {0: 1.0}), (-0.3, {0: 1.0})) == {}
    assert expressions.combination((4.0, {0: 1.0, 1: 1.1e-12, 2: 0.9e-12})) == {0: 4.0, 1: 4.4e-12}
    assert expressions.combination() == {}


def test_coefficients_of_rounding_are_left_out():
    found = expressions.cleaned({0: -2.0, 1: 2e-12, 2: -2.1e-12, ONE: 1.9e-12})
    assert found == {0: -2.0, 2: -2.1e-12}


def test_products_and_sums_of_polynomials():
    pairs = [({ONE: 2.0, 1: 3.0}, {0: 5.0, 1: 7.0}), ({0: 1.0}, {1: 1.0})]
    assert expressions.product_sum(pairs, 0.5) == {(ONE, 0): 5.0, (ONE, 1): 7.0, (0, 1): 8.0, (1, 1): 10.5}
    assert expressions.product_sum(pairs[1:]) == {(0, 1): 1.0}
    before = {(ONE, 0): 1.0}
    assert expressions.plus(before, 2.0, {0: 3.0, ONE: 4.0}) == {(ONE, 0): 7.0, (ONE, ONE): 8.0}
    assert before == {(ONE, 0): 1.0}


@pytest.mark.parametrize(
    ("equation", "keys"),
    [
        ({ONE: 1e-15, 0: 1.0, 1: 1e-12, 2: -1.1e-12}, {ONE, 0, 2}),
        ({ONE: 5.0, 0: 1e-9, 1: -1e-9}, {ONE}),
        ({ONE: 5.0, 0: 1.1e-9, 1: 1e-12, 2: 1.1e-12}, {ONE, 0, 2}),
        ({0: -3.0, 1: 1e-13}, {0}),
        ({ONE: 1e-15}, {ONE}),
    ],
)
def test_significant_coefficients(equation, keys):
    assert set(expressions.significant(equation, ONE)) == keys


@pytest.mark.parametrize(
    ("polynomial", "degree"),
    [
        ({}, 0),
        ({(ONE, ONE): 1.0}, 0),
        ({(ONE, ONE): 1.0, (ONE, 4): 1.0}, 1),
        ({(0, 1): 1.0}, 2),
        ({(ONE, 0): 1.0, (1, 1): 1.0}, 2),
    ],
)
def test_degrees(polynomial, degree):
    assert expressions.degree(polynomial) == degree


def test_a_polynomial_of_degree_one_is_an_expression():
    assert expressions.as_expression({(ONE, ONE): 2.0, (ONE, 3): -1.0}) == {ONE: 2.0, 3: -1.0}


# --- eliminations -------------------------------------------------------------------------------------------
def test_variables_are_eliminated_in_all_expressions():
    """x0 + 2 x1 = 4, then x0 + x2 = -1; variable 2 may not go."""
    eliminate = Elimination(lambda variable, _: variable != 2)
    assert eliminate({1: 3.0}) == {1: 3.0}
    eliminate.add({0: 1.0, 1: 2.0, ONE: -4.0})
    assert eliminate.expressed == {1: {0: -0.5, ONE: 2.0}}
    eliminate.add({0: 1.0, 2: 1.0, ONE: 1.0})
    assert eliminate.expressed == {0: {2: -1.0, ONE: -1.0}, 1: {2: 0.5, ONE: 2.5}}
    assert eliminate({0: 2.0, 1: 4.0, 3: 1.0}) == {ONE: 8.0, 3: 1.0}
    eliminate.add({0: 1.0, 2: 1.0, ONE: 1.0})
    assert not eliminate.left
    eliminate.add({2: 3.0, ONE: 1.0})
    assert eliminate.left == [{2: 3.0, ONE: 1.0}] and len(eliminate.expressed) == 2
    eliminate.add({3: 1.0, 2: 0.5})
    assert eliminate.expressed[3] == {2: -0.5} and set(eliminate.expressed) == {0, 1, 3}


@pytest.mark.parametrize(
    ("equation", "gone"),
    [
        ({3: 1.0, 4: -1.0}, 4),
        ({3: -1.0 - 1e-10, 4: 1.0}, 4),
        ({3: -1.0 - 1e-8, 4: 1.0}, 3),
        ({3: 0.5, 4: 0.25, ONE: 9.0}, 3),
    ],
)
def test_the_largest_coefficient_goes_and_of_equal_ones_the_last(equation, gone):
    eliminate = Elimination(lambda *_: True)
    eliminate.add(equation)
    assert list(eliminate.expressed) == [gone]


def test_equations_are_tried_again_after_others():
    """Only an equation without further variables eliminates: x5 + x6 = 0 waits for x6 = 2."""
    eliminate = Elimination(lambda _, others: others == 0)
    eliminate.add({5: 1.0, 6: 1.0})
    eliminate.add({7: 1.0, 6: 1.0, 8: 1.0})
    assert len(eliminate.left) == 2 and not eliminate.expressed
    eliminate.add({6: 1.0, ONE: -2.0})
    eliminate.settle()
    assert eliminate.expressed == {6: {ONE: 2.0}, 5: {ONE: -2.0}}
    assert eliminate.left == [{7: 1.0, 8: 1.0, ONE: 2.0}]
    eliminate.add({8: 1.0, ONE: 1.0})
    eliminate.settle()
    assert eliminate.expressed[7] == {ONE: -1.0} and not eliminate.left


def test_a_variable_whose_coefficient_vanishes_does_not_go():
    eliminate = Elimination(lambda variable, _: variable == 0)
    eliminate.add({0: 1e-9, 1: 1.0})
    assert eliminate.left == [{0: 1e-9, 1: 1.0}] and not eliminate.expressed
    eliminate.add({0: 1.1e-9, 1: 1.0})
    assert list(eliminate.expressed) == [0]


CIRCLE: Polynomial = {(0, 0): 1.0, (ONE, ONE): -1.0}
PRODUCT: Polynomial = {(0, 1): 2.0, (ONE, 1): 1.0, (ONE, ONE): 3.0}


@pytest.mark.parametrize(
    ("factors", "more", "kept"),
    [
        ((2.0, 3.0), {}, False),
        ((2.0, 3.0), {(ONE, 2): 1e-9}, False),
        ((2.0, 3.0), {(ONE, 2): 1e-8}, True),
        ((0.1, 0.0), {(1, 1): 1e-10}, False),
        ((0.1, 0.0), {(1, 1): 1.5e-10}, True),
        ((1.0, 0.0), {(ONE, ONE): 5.0}, False),
    ],
)
def test_dependent_polynomials_are_left_out(factors, more, kept):
    """A combination of two others, and of 1; sizes are relative to the largest coefficient."""
    combined: Polynomial = dict(more)
    for factor, polynomial in zip(factors, (CIRCLE, PRODUCT), strict=True):
        for key, value in polynomial.items():
            combined[key] = combined.get(key, 0.0) + factor * value
    combined = {key: value for key, value in combined.items() if value}
    combined |= dict.fromkeys([(8, 8), (8, 9)], 0.0)  # longer than the others, so that it comes last
    found = expressions.independent([combined, PRODUCT, CIRCLE])
    assert found == [CIRCLE, PRODUCT, *[combined] * kept]


def test_three_polynomials_of_two_monomials():
    first, second, third = ({(0, 0): a, (1, 1): b} for a, b in ((1.0, 1.0), (1.0, 2.0), (5.0, 1.0)))
    assert expressions.independent([first, second, third]) == [first, second]
    assert expressions.independent([third, first, second]) == [third, first]


# --- variables ----------------------------------------------------------------------------------------------
def test_variables_are_forms_of_poses():
    """Positions are in units of 2 m."""
    vectors = DirectionVectors(2.0)
    assert vectors.add(1, np.full((2, 12), 3.0)) == (0, 1)
    assert (
        vectors.add(4, np.full((1, 12), 5.0), np.full((1, 12), 7.0), driver=6) == (2,) and len(vectors) == 3
    )
    body, driver, along, across = vectors.pose_maps([2, 0])
    assert body.tolist() == [4, 1] and driver.tolist() == [6, NO_DRIVER]
    assert along.tolist() == [[2.5] * 3 + [5.0] * 9, [1.5] * 3 + [3.0] * 9]
    assert across.tolist() == [[3.5] * 3 + [7.0] * 9, [0.0] * 12]


def test_forms_of_a_direction_along_axes():
    axes, local = np.array([[0.1, 0.2, 0.3], [1.0, -1.0, 0.5]]), np.array([0.7, -0.4, 0.2])
    turn = rotations.to_matrix(rotations.from_vector(np.array([0.3, 0.5, -0.8])))
    pose = np.append([9.0, 9.0, 9.0], turn.ravel())
    assert direction_forms(axes, local) @ pose == pytest.approx(axes @ turn @ local, abs=1e-15)


@pytest.mark.parametrize(
    ("length", "unit"), [(1.0, 1.0), (1.41, 1.0), (1.42, 2.0), (0.3, 0.25), (0.36, 0.5), (100.0, 128.0)]
)
def test_the_unit_of_length_is_a_power_of_two(length, unit):
    assert unit_of_length(length) == unit


def test_sums_of_products_of_forms():
    one, other = np.cos(np.arange(24.0)).reshape(2, 3, 4), np.sin(np.arange(12.0)).reshape(2, 3, 2)
    assert sum_of_products(one, other) == pytest.approx(np.einsum("ski,skj->sij", one, other), abs=1e-15)
    assert sum_of_products(one) == pytest.approx(np.einsum("ski,skj->sij", one, one), abs=1e-15)


# --- orientations -------------------------------------------------------------------------------------------
TURN = rotations.to_matrix(rotations.from_vector(np.array([0.2, -0.6, 0.9])))
BASIS = np.array([[1.0, 0.2, 0.0], [0.0, 1.0, 0.3], [0.06, -0.3, 1.0]])


def evaluated(triple: Any, values: Any) -> list[float]:
    at = {ONE: 1.0, **values}
    return [sum(c * at[v] for v, c in expression.items()) for expression in triple]


def test_directions_of_a_fixed_orientation():
    assert FIXED.direction_vector(np.array([0.5, 0.0, -2.0])) == ({ONE: 0.5}, {}, {ONE: -2.0})
    assert not list(FIXED.rows())


def test_directions_of_a_free_orientation():
    """The variables are the components of R b of the three directions b of the basis."""
    free = Orientation(tuple(range(10, 19)), BASIS)
    values = dict(zip(free.variables, (TURN @ BASIS.T).T.ravel(), strict=True))
    w = np.array([0.3, -0.8, 0.5])
    assert evaluated(free.direction_vector(w), values) == pytest.approx((TURN @ w).tolist(), abs=1e-14)
    for k, b in enumerate(BASIS):
        expected = tuple({10 + 3 * k + c: pytest.approx(1.0)} for c in range(3))
        assert free.direction_vector(b) == expected
    rows = list(free.rows())
    assert len(rows) == 6 and all(
        abs(sum(c * {ONE: 1.0, **values}[i] * {ONE: 1.0, **values}[j] for (i, j), c in row.items())) < 1e-14
        for row in rows
    )
    squares = [(row.get((10, 10)), row[ONE, ONE]) for row in rows]
    products = [b @ d for b, d in itertools.combinations_with_replacement(BASIS, 2)]
    halves = [0.5, 1.0, 1.0, 0.5, 1.0, 0.5]
    assert squares[0] == (0.5, pytest.approx(-0.5 * products[0]))
    assert [s for _, s in squares] == pytest.approx([-h * p for h, p in zip(halves, products, strict=True)])


def test_directions_that_turn_about_an_axis_at_rest():
    """The basis is (arm, across, axis) with the arm at 0.5 rad in the frame."""
    axis = np.array([2.0, -1.0, 2.0]) / 3
    first = np.array([1.0, 2.0, 0.0]) / math.sqrt(5)
    frame = np.array([first, np.cross(axis, first), axis])
    arm = math.cos(0.5) * frame[0] + math.sin(0.5) * frame[1]
    turned = Orientation((3, 4), np.array([arm, np.cross(axis, arm), axis]), frame)
    values, w = {3: math.cos(1.2), 4: math.sin(1.2)}, np.array([0.3, -0.8, 0.5])
    turn = rotations.to_matrix(rotations.from_vector(0.7 * axis))
    assert evaluated(turned.direction_vector(w), values) == pytest.approx((turn @ w).tolist(), abs=1e-14)
    assert list(turned.rows()) == [{(3, 3): 0.5, (4, 4): 0.5, (ONE, ONE): -0.5}]


def test_parallel_axes_and_axes_of_an_orientation():
    x, y, z = np.eye(3)
    assert orientations._are_parallel(x, -x) and orientations._are_parallel(x, x + 0.99e-9 * y)
    assert not orientations._are_parallel(x, x + 1.01e-9 * y) and not orientations._are_parallel(x, 1e-9 * y)
    known: dict[int, list[np.ndarray]] = {}
    assert orientations._keep(known, 2, x) and not orientations._keep(known, 2, -x)
    assert orientations._keep(known, 2, y) and not orientations._keep(known, 2, z)
    assert [list(axis) for axis in known[2]] == [list(x), list(y)] and list(known) == [2]


def test_a_basis_has_directions_with_an_angle():
    """The second direction has at least a sine of 0.2 to the first."""
    x, y, z = np.eye(3)
    near, far = (math.sqrt(1 - s * s) * x + s * y for s in (0.199, 0.201))
    found = orientations._basis(iter([x, near, far, z]))
    assert found == pytest.approx(np.array([x, far, z]), abs=1e-15)
    assert orientations._basis(iter([x, 0.2 * y, z]))[1].tolist() == z.tolist()


# --- tables -------------------------------------------------------------------------------------------------
def test_products_stand_in_vectors_of_lanes():
    """Ten lanes make two blocks; the first has lanes with two terms, and places for two of each lane."""
    terms: Any = [[(1, 2, 0.5), (3, 4, 0.25)], [], [(5, 6, 2.0)]] + [[]] * 6 + [[(7, 8, 3.0)]]
    left, right, weight, start = polynomials.products_of_lanes(terms)
    assert start.tolist() == [0, 16, 18] and weight.tolist()[:3] == [0.5, 0.0, 2.0]
    assert weight.tolist()[8:] == [0.25, *[0.0] * 8, 3.0]
    assert (left[[0, 8, 2, 17]].tolist(), right[[0, 8, 2, 17]].tolist()) == ([1, 3, 5, 7], [2, 4, 6, 8])


def test_columns_of_tables():
    first, second, number = polynomials._columns([(1, 2, 0.5), (3, 4, 0.25)], 2)
    assert first.tolist() == [1, 3] and second.tolist() == [2, 4] and number.tolist() == [0.5, 0.25]
    empty = polynomials._columns([], 2)
    assert [column.shape for column in empty] == [(0,)] * 3
    assert [column.dtype for column in empty] == [np.int64, np.int64, float]


def test_arrays_of_numbers_of_scenes():
    batch = numbers.ManyScenes(2)
    one = numbers.BatchNumber(np.array([1.0, -4.0]), batch)
    assert numbers.array_of([1.0, 2]).dtype == float and numbers.array_of([1.0, one]).dtype == object
    assert numbers.scalar(one) is one and isinstance(numbers.scalar(np.float64(2)), float)
    assert numbers.of_first(one) == 1.0 and numbers.of_first(3.0) == 3.0
    assert numbers.largest([one, -2.0, 3.0]).values.tolist() == [3.0, 4.0]
    assert numbers.largest([-2.0, 1.0]) == 2.0 and numbers.largest([]) == 0.0
    assert numbers.largest([one]).values.tolist() == [1.0, 4.0]


def test_numbers_of_scenes_together():
    """Numbers are floats where all scenes have the same bits; the first scene gives the indices."""
    batch = numbers.ManyScenes(3)
    mixed = batch.together(
        np.array([[[1.0, 0.0], [3.0, 5.0]], [[1.0, -0.0], [3.0, 6.0]], [[1.0, 0.0], [3.0, 5.0]]])
    )
    assert mixed.dtype == object and mixed.shape == (2, 2) and (mixed[0, 0], mixed[1, 0]) == (1.0, 3.0)
    assert isinstance(mixed[0, 0], float) and mixed[1, 1].values.tolist() == [5.0, 6.0, 5.0]
    assert np.signbit(mixed[0, 1].values).tolist() == [False, True, False] and mixed[1, 1].batch is batch
    spread = batch.spread(mixed)
    assert spread.shape == (3, 2, 2) and spread[1].tolist() == [[1.0, 0.0], [3.0, 6.0]]
    same = batch.together(np.array([[1.0, 2.0]] * 3))
    assert same.dtype == float and same.tolist() == [1.0, 2.0]
    assert batch.together(np.array([[1, 2], [3, 4]])).tolist() == [1, 2] and batch.agree.all()


def test_patterns_of_numbers_of_scenes():
    """The first scene gives the pattern; scenes with an entry outside it are noted."""
    batch, values = numbers.ManyScenes(4), np.ones((4, 2, 3))
    values[:, 0, 1] = values[2, 1, 2] = values[3] = 0.0
    values[1] *= -7.0
    assert batch.pattern(values).tolist() == [[True, False, True], [True, True, True]]
    assert batch.agree.tolist() == [True, True, False, False]
    batch.agree[1] = False
    batch.pattern(np.ones((4, 2)))
    assert batch.agree.tolist() == [True, False, False, False]
    one = numbers.OneScene()
    assert one.pattern(np.array([0.0, -2.0])).tolist() == [False, True] and one.spread(values) is values
    assert (one.number_type, batch.number_type) == (float, object)


def decided(number: Any, batch: numbers.ManyScenes) -> tuple[bool, list[bool]]:
    return bool(number), batch.agree.tolist()


@pytest.mark.parametrize(
    ("decide", "answer", "agree"),
    [
        (lambda n: n, True, [True, False, True]),
        (lambda n: n < 1.0, False, [True, False, True]),
        (lambda n: n > 1.0, False, [True, True, False]),
        (lambda n: n == 1.0, True, [True, False, False]),
        (lambda n: n < 0.0, False, [True, True, True]),
    ],
)
def test_decisions_of_scenes(decide, answer, agree):
    batch = numbers.ManyScenes(3)
    assert decided(decide(numbers.BatchNumber(np.array([1.0, 0.0, 2.0]), batch)), batch) == (answer, agree)


def test_operations_with_floats_on_the_left():
    number = numbers.BatchNumber(np.array([1.0, 4.0]), numbers.ManyScenes(2))
    for found, expected in (
        (2.0 - number, [1.0, -2.0]),
        (2.0 / number, [2.0, 0.5]),
        (2.0 + number, [3.0, 6.0]),
        (2.0 * number, [2.0, 8.0]),
        (number - 2.0, [-1.0, 2.0]),
        (number / 2.0, [0.5, 2.0]),
        (-number, [-1.0, -4.0]),
        (numbers.root(number), [1.0, 2.0]),
    ):
        assert found.values.tolist() == expected


# --- loads --------------------------------------------------------------------------------------------------
class Shaped:
    """Bodies 0 and 1 at variables 0 … 2 and 3 … 5 of unit 2 m, whose axes are constant or variables 6 … 8."""

    nb, d, length = 2, 9, 2.0

    def __init__(self) -> None:
        self.of = self
        self.angles = {1: (4, -0.5)}
        table = dict.fromkeys(("direction_first", "turning_first", "direction_second"), np.eye(3)[[0, 1]])
        self.model = SimpleNamespace(
            data=SimpleNamespace(
                primitives=SimpleNamespace(
                    first=np.array([0, 0]), second=np.array([1, 1]), angle=np.array([5, 3]), **table
                )
            )
        )
        self.centres = np.zeros((2, 3, 9))
        for b, c in itertools.product(range(2), range(3)):
            self.centres[b, c, 3 * b + c] = 1.0

    def __call__(self, found: Any) -> tuple[np.ndarray, np.ndarray]:
        rows = [e for e in found]
        constant, matrix = np.zeros(len(rows)), np.zeros((len(rows), 9))
        for k, row in enumerate(rows):
            for v, c in row.items():
                if v == ONE:
                    constant[k] = c
                else:
                    matrix[k, v] = c
        return constant, matrix

    def point(self, body: int, local: np.ndarray) -> Any:
        """A point of body 0 or 1 does not turn; a point of the ground is at rest."""
        rest = [{ONE: c / 2} for c in local]
        return rest if body == 2 else [{3 * body + c: 1.0, **rest[c]} for c in range(3)]

    def direction(self, body: int, local: np.ndarray) -> Any:
        """Body 1 turns: its directions are those of the ground times the variable 6."""
        return [{(6 if body == 1 else ONE): c} for c in local]

    def spread(self, array: np.ndarray) -> np.ndarray:
        return array

    def of_axes(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Axes (1, 0, 0), (0, 1, 0) + (x7, x8, 0) and (0, 0, 0)."""
        form = np.zeros((9, 9))
        form[3, 7] = form[4, 8] = 1.0
        return np.array([1.0, 0, 0, 0, 1, 0, 0, 0, 0]), form


def loads(**columns: Any) -> Any:
    count = len(columns["kind"])
    empty = {
        name: np.zeros((count, 3))
        for name in ("point_first", "point_second", "force", "axis", "x_first", "y_first", "x_second")
    }
    empty |= {name: np.zeros(count) for name in ("stiffness", "damping", "natural")}
    empty |= {name: np.zeros(count, int) for name in ("first", "second", "angle")}
    arrays = {name: np.array(column) for name, column in columns.items()}
    return SimpleNamespace(**{**empty, "function": np.full(count, -1), **arrays})


def test_weights_and_constant_forces():
    """Weights of 3 kg and 5 kg; a force on body 1, one on the ground, and one that a function multiplies."""
    made = loads(
        kind=[FORCE, FORCE, FORCE],
        first=[1, 2, 0],
        force=[[1.0, 2.0, 3.0], [9.0] * 3, [9.0] * 3],
        function=[-1, -1, 0],
    )
    data: Any = SimpleNamespace(
        loads=made, bodies=SimpleNamespace(mass=np.array([3.0, 5.0])), gravity=np.array([0.0, -10.0, 4.0])
    )
    force, linear = load_polynomials.constant_forces(data, Shaped())  # type: ignore[arg-type]
    assert force.tolist() == [0.0, -15.0, 6.0, 0.5, -24.0, 11.5, 0.0, 0.0, 0.0]
    assert linear.shape == (9, 9) and not linear.any()


def test_moments_are_halves_of_moments_on_three_axes():
    """½ Σ (m × a) · δa over the axes a, of which the second is (x7, 1 + x8, 0); m is (1, 2, 3) times 4."""
    made = loads(kind=[MOMENT], first=[1], force=[[4.0, 8.0, 12.0]])
    data: Any = SimpleNamespace(loads=made, bodies=SimpleNamespace(mass=np.zeros(2)), gravity=np.zeros(3))
    force, linear = load_polynomials.constant_forces(data, Shaped())  # type: ignore[arg-type]
    assert force.tolist() == [0.0] * 7 + [-1.5, 0.0]
    assert linear[7, 8] == -1.5 and linear[8, 7] == 1.5 and np.count_nonzero(linear) == 2


def test_springs_between_points():
    made = loads(
        kind=[MOMENT, SPRING],
        first=[0, 0],
        second=[0, 2],
        point_first=[[0.0] * 3, [2.0, 4.0, 6.0]],
        point_second=[[0.0] * 3, [8.0, 10.0, 14.0]],
        stiffness=[9.0, 40.0],
        damping=[9.0, 7.0],
        natural=[9.0, 3.0],
    )
    found = load_polynomials.springs_of(made, Shaped())  # type: ignore[arg-type]
    assert found.constant.tolist() == [[3.0, 3.0, 4.0]] and found.form.tolist() == (-np.eye(9)[:3]).tolist()
    assert [c.tolist() for c in found[2:]] == [[40.0], [7.0], [1.5]]


def test_loads_about_axes_and_coupled_angles():
    made = loads(
        kind=[SPRING, ABOUT_AXIS],
        first=[0, 0],
        second=[0, 1],
        x_first=[[9.0] * 3, [1.0, 2.0, 3.0]],
        y_first=[[9.0] * 3, [4.0, 5.0, 6.0]],
        x_second=[[9.0] * 3, [7.0, 8.0, 9.0]],
        stiffness=[9.0, 40.0],
        damping=[9.0, 12.0],
        natural=[9.0, 0.3],
        force=[[9.0] * 3, [20.0, 9.0, 9.0]],
        function=[9, 2],
        angle=[9, 6],
    )
    shaped: Any = Shaped()
    angles = load_polynomials.coupled_angles(shaped)
    found = load_polynomials.torsions_of(made, shaped, angles)
    assert found.constant.tolist() == [[1, 2, 3, 4, 5, 6, 0, 0, 0], [0, 1, 0, 0, 1, 0, 0, 0, 0]]
    assert found.form[6:9, 6].tolist() == [7.0, 8.0, 9.0] and found.form[15:, 6].tolist() == [0.0, 1.0, 0.0]
    assert np.count_nonzero(found.form) == 4 and found.form.shape == (18, 9)
    assert found.stiffness.tolist() == [10.0, 0.0] and found.damping.tolist() == [3.0, 0.0]
    assert found.natural.tolist() == [0.3, 0.0] and found.amount.tolist() == [5.0, 0.0]
    assert found.function.tolist() == [2, -1] and found.slot.tolist() == [6, 3]
    assert found.row.tolist() == [-1, 4] and found.factor.tolist() == [0.0, -0.5]


def test_loads_along_axes():
    made = loads(
        kind=[ALONG_AXIS],
        first=[1],
        second=[0],
        axis=[[1.0, 2.0, 3.0]],
        point_first=[[2.0, 4.0, 6.0]],
        point_second=[[8.0, 10.0, 14.0]],
        stiffness=[40.0],
        damping=[12.0],
        natural=[3.0],
        force=[[20.0, 9.0, 9.0]],
        function=[2],
    )
    found = load_polynomials.slides_of(made, Shaped())  # type: ignore[arg-type]
    assert found.constant.tolist() == [[0, 0, 0, 3, 3, 4]]
    assert found.form[:3, 6].tolist() == [1.0, 2.0, 3.0] and found.form.shape == (6, 9)
    assert found.form[3:, :6].tolist() == np.hstack([np.eye(3), -np.eye(3)]).tolist()
    assert [c.tolist() for c in found[2:]] == [[40.0], [12.0], [1.5], [10.0], [2]]


def test_forces_that_functions_multiply():
    made = loads(
        kind=[FORCE, MOMENT, FORCE, SPRING],
        first=[0, 1, 1, 0],
        force=[[9.0] * 3, [4.0, 8.0, 12.0], [2.0, 4.0, 6.0], [9.0] * 3],
        function=[-1, 3, 0, 5],
    )
    found = load_polynomials.timed_forces(made, Shaped())  # type: ignore[arg-type]
    assert (
        found.function.tolist() == [3, 0] and found.constant.shape == (2, 9) and found.linear.shape == (18, 9)
    )
    assert found.constant.tolist() == [[0.0] * 7 + [-1.5, 0.0], [0, 0, 0, 1.0, 2.0, 3.0, 0, 0, 0]]
    assert found.linear[7, 8] == -1.5 and found.linear[8, 7] == 1.5
    assert np.count_nonzero(found.linear) == 2


class Scenes(Shaped):
    """Scenes whose forms differ by a factor each; the first axis counts them unless one is alone."""

    def __init__(self, *factors: float, alone: bool = False) -> None:
        super().__init__()
        self.factors, self.alone = factors, alone
        self.centres = self.spread(self.centres)

    def spread(self, array: np.ndarray) -> np.ndarray:
        found = np.array([factor * array for factor in self.factors])
        return found[0] if self.alone else found


def test_forces_and_moments_of_several_scenes():
    """Each scene has its own masses, gravity and forces; together they have the same numbers as alone."""
    kinds: Any = {"kind": [FORCE, MOMENT, MOMENT, FORCE], "first": [0, 1, 1, 1], "function": [-1, -1, 1, 0]}
    force = np.cos(np.arange(36.0)).reshape(3, 4, 3)
    mass, gravity = np.sin(1.0 + np.arange(6.0)).reshape(3, 2), np.cos(2.0 + np.arange(9.0)).reshape(3, 3)

    def found(forms: Any, k: Any) -> list[np.ndarray]:
        made = loads(force=force[k], **kinds)
        data: Any = SimpleNamespace(loads=made, bodies=SimpleNamespace(mass=mass[k]), gravity=gravity[k])
        _, constant, linear = load_polynomials.timed_forces(made, forms)
        return [*load_polynomials.constant_forces(data, forms), constant, linear]

    factors = 1.0, -2.0, 0.5
    together = found(Scenes(*factors), slice(None))
    assert [each.shape for each in together] == [(3, 9), (3, 9, 9), (3, 2, 9), (3, 18, 9)]
    for k, factor in enumerate(factors):
        for one, other in zip(together, found(Scenes(factor, alone=True), k), strict=True):
            assert one[k] == pytest.approx(other, abs=1e-15) and np.abs(other).max() > 0.01


def test_amounts_of_several_scenes():
    """Torques and forces of two scenes; the coupled angle has none."""
    kinds: Any = {"kind": [ABOUT_AXIS, ALONG_AXIS, ABOUT_AXIS], "first": [0] * 3, "second": [1] * 3}
    made = loads(force=np.arange(18.0).reshape(2, 3, 3), **kinds)
    shaped: Any = Shaped()
    angles = load_polynomials.coupled_angles(shaped)
    torsions = load_polynomials.torsions_of(made, shaped, angles)
    assert torsions.amount.tolist() == [[0.0, 1.5, 0.0], [2.25, 3.75, 0.0]]
    assert torsions.row.tolist() == [-1, -1, 4] and torsions.function.tolist() == [-1, -1, -1]
    assert load_polynomials.slides_of(made, shaped).amount.tolist() == [[1.5], [6.0]]


# --- orientations of a mechanism ----------------------------------------------------------------------------
def of_bodies(moving: Any, joints: Any = (), group: Any = None) -> Any:
    """Orientations of bodies whose principal axes are those of the world at first."""
    found = orientations.Orientations.__new__(orientations.Orientations)
    count = len(moving)
    found.nb, found._moving, found._axes = count, np.array(moving, bool), np.tile(np.eye(3), (count, 1, 1))
    found.group = list(range(count)) if group is None else group
    names = [f"b{k}" for k in range(count)]
    found.model = SimpleNamespace(  # type: ignore[assignment]
        joints=joints,
        index=lambda name: names.index(name) if name in names else count,
        to_local=np.tile(np.eye(3), (count + 1, 1, 1)),
        bodies=[SimpleNamespace(name=name) for name in names],
    )
    return found


def joint(
    first: str, second: str, rotations_lost: int, *axes: Any, translations_lost: int = 3, **more: Any
) -> Any:
    facts = SimpleNamespace(
        forbidden_rotations=(0,) * rotations_lost, forbidden_translations=(0,) * translations_lost
    )
    pair = more.get("anchors", ((0.0, 0.0, 0.0),) * 2)
    return SimpleNamespace(facts=facts, bodies=(first, second), directions=axes, anchor_pair=pair)


def as_lists(found: Any) -> Any:
    return {group: [axis.tolist() for axis in axes] for group, axes in found.items() if group >= 0}


def test_axes_at_rest_of_bodies_that_turn_about_principal_axes():
    """One axis of a body that turns about one, none of one that turns about several, two of one at rest."""
    made = of_bodies([[0, 0, 1], [1, 1, 0], [0, 0, 0], [1, 1, 1]])
    x, y, z = np.eye(3).tolist()
    assert as_lists(made._axes_at_rest()) == {0: [z], 2: [x, y]}
    together = of_bodies([[0, 0, 1], [1, 0, 0]], group=[0, 0])
    assert as_lists(together._axes_at_rest()) == {0: [z, x]}


def test_axes_at_rest_are_passed_on_by_hinges():
    """From the ground to b0, b1 and b2, against the order of the joints; b3 turns about another axis."""
    z, y = (0.0, 0.0, 2.0), (0.0, 3.0, 0.0)
    chain = [
        joint("b1", "b2", 2, z),
        joint("b1", "b0", 2, z),
        joint("ground", "b0", 2, z),
        joint("b2", "b3", 2, y),
    ]
    free = [[1, 1, 1]] * 4
    assert as_lists(of_bodies(free, chain)._axes_at_rest()) == {k: [[0.0, 0.0, 1.0]] for k in range(3)}
    shared = list(of_bodies(free, chain).shared_axes())
    assert [(one[0], other[0]) for one, other in shared] == [(1, 2), (1, 0), (-1, 0), (2, 3)]
    assert shared[3][1][1].tolist() == [0.0, 1.0, 0.0]
    assert not list(of_bodies(free, [joint("b0", "b1", 3), joint("b0", "b1", 0, z)]).shared_axes())


def test_bodies_that_joints_hold_in_one_orientation():
    """The ground holds b2, and b1 holds b3 and b0: the smallest number is kept."""
    made = of_bodies(
        [[1, 1, 1]] * 4,
        [
            joint("b3", "b1", 3),
            joint("ground", "b2", 3),
            joint("b0", "b1", 3),
            joint("b2", "b3", 2, (0, 0, 1)),
        ],
    )
    assert made._groups() == [0, 0, -1, 0]
    made.group = [0, 0, -1, 0]
    assert [made.number(body) for body in (0, 2, 3, 4)] == [0, -1, 0, -1]
    assert [made._group_of(name) for name in ("b1", "b2", "ground")] == [0, -1, -1]


def test_kinds_of_orientations():
    """Two axes at rest fix an orientation, one axis lets it turn, and none leaves it free."""
    made = of_bodies([[1, 1, 1]] * 3)
    x, y, z = np.eye(3)
    made._axes_at_rest = lambda: {-1: [x, y], 0: [x, y], 1: [z]}
    made._turning = lambda group, axis: ("turning", group, axis.tolist())
    made._free = lambda group: ("free", group)
    assert made._orientations() == {-1: FIXED, 0: FIXED, 1: ("turning", 1, [0.0, 0.0, 1.0]), 2: ("free", 2)}


def test_the_frame_of_an_orientation_that_turns():
    """The first direction is that of a slide across the axis, or the unit vector farthest from the axis."""
    z = np.array([0.0, 0.0, 1.0])
    plain = of_bodies([[1, 1, 1]])._frame(z)
    assert plain.tolist() == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    slide = joint("b0", "ground", 3, (0.0, 3.0, 0.0), translations_lost=2)
    along = joint("b0", "ground", 3, (0.0, 0.0, 1.0), translations_lost=2)
    hinge = joint("b0", "ground", 2, (1.0, 1.0, 0.0))
    found = of_bodies([[1, 1, 1]], [hinge, along, slide])._frame(z)
    assert found.tolist() == [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    axis = np.array([0.6, 0.0, 0.8])
    tilted = of_bodies([[1, 1, 1]])._frame(axis)
    assert tilted @ tilted.T == pytest.approx(np.eye(3)) and tilted[2] is not axis and tilted[2] @ axis == 1.0
    assert tilted[0].tolist() == [0.0, 1.0, 0.0] and np.linalg.det(tilted) == pytest.approx(1.0)


def test_directions_for_the_basis_of_an_orientation():
    """Axes of joints on the bodies, arms between anchors, and principal axes, in this order."""
    anchors = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((9.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    joints = [
        joint("ground", "b0", 2, (0.0, 0.0, 2.0), anchors=anchors[0]),
        joint("b1", "b0", 1, (3.0, 0.0, 0.0), (0.0, 5.0, 0.0), anchors=anchors[1]),
        joint("b1", "ground", 2, (1.0, 0.0, 0.0)),
    ]
    found = np.array(list(of_bodies([[1, 1, 1]] * 2, joints)._directions(0)))
    x, y, z = np.eye(3).tolist()
    assert found.tolist() == [z, y, y, x, y, z]


def test_an_orientation_that_turns_has_an_arm_across_its_axis():
    """The first direction with more than 0.2 across the axis; its variables are along the frame."""
    made = of_bodies([[1, 1, 1]])
    near = np.array([0.19, 0.0, math.sqrt(1 - 0.19**2)])
    far = np.array([0.0, 0.6, 0.8])
    made._directions = lambda group: iter([near, far])
    asked: list[Any] = []
    made._variables = lambda *given: asked.append(given) or (4, 5)
    found = made._turning(0, np.array([0.0, 0.0, 1.0]))
    assert found.basis.tolist() == [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    assert found.variables == (4, 5) and found.frame[2].tolist() == [0.0, 0.0, 1.0]
    [(group, axes, [arm])] = asked
    assert group == 0 and axes.tolist() == found.frame[:2].tolist() and arm.tolist() == [0.0, 1.0, 0.0]


def test_variables_of_directions_belong_to_the_first_body_of_their_orientation():
    made = of_bodies([[1, 1, 1]] * 3, group=[0, 1, 1])
    made._axes[1] = TURN
    made._direction_vectors = DirectionVectors(1.0)
    axes, w = np.eye(3)[:2], np.array([0.3, -0.8, 0.5])
    assert made._variables(1, axes, [w, w]) == (0, 1, 2, 3)
    body, _, along, _ = made._direction_vectors.pose_maps(range(4))
    assert body.tolist() == [1] * 4
    turn = rotations.to_matrix(rotations.from_vector(np.array([0.5, 0.1, 0.7])))
    pose = np.append(np.zeros(3), (turn @ TURN).ravel())
    assert along @ pose == pytest.approx(np.tile(axes @ turn @ w, 2), abs=1e-14)
