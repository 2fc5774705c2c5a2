"""Batch numbers, one value a scene: results are bit-identical with those of each scene alone, and scenes that
decide otherwise leave the batch."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mbref.taylor.numbers import BatchNumber, ManyScenes, dot, largest, norm, root

PLAIN = st.floats(0.1, 10.0)
VALUES = st.lists(st.tuples(PLAIN, PLAIN), min_size=2, max_size=5)


def mixed(x, y):
    """Combine two numbers by every operation, with constants on both sides."""
    return root(abs(2.0 - x * y) + 1.0 / (x + 0.5)) - (x - y) / 3.0 + (-x) * 0.25 + 1.0


@given(values=VALUES)
def test_operations_on_a_batch_are_bit_identical_with_each_scene_alone(values):
    batch = ManyScenes(len(values))
    x, y = batch.together(np.array(values))
    found = batch.spread(np.array([mixed(x, y)], dtype=object))[:, 0]
    assert found.tolist() == [mixed(*pair) for pair in values]
    assert batch.agree.all()


@given(values=st.lists(st.lists(PLAIN, min_size=6, max_size=6), min_size=2, max_size=4))
def test_products_norms_and_maxima_of_a_batch_are_bit_identical_with_each_scene_alone(values):
    rows, batch = np.array(values), ManyScenes(len(values))
    numbers = batch.together(rows)
    found = np.array([dot(numbers[:3], numbers[3:]), norm(numbers[:3]), largest(numbers)], dtype=object)
    alone = [[dot(row[:3], row[3:]), norm(row[:3]), largest(row)] for row in rows]
    assert batch.spread(found).tolist() == np.array(alone, dtype=float).tolist()


def test_number_on_which_all_scenes_agree_is_a_float():
    together = ManyScenes(2).together(np.array([[1.0, 2.0, 0.0], [1.0, 3.0, -0.0]]))
    assert isinstance(together[0], float) and isinstance(together[1], BatchNumber)
    assert isinstance(together[2], BatchNumber), "the signs of zeros differ"
    assert ManyScenes(2).together(np.array([[1.0, 2.0], [1.0, 2.0]])).dtype == float


def test_scene_that_compares_otherwise_than_the_first_leaves_the_batch():
    batch = ManyScenes(3)
    number = BatchNumber(np.array([1.0, 2.0, -1.0]), batch)
    assert number > 0.0 and batch.agree.tolist() == [True, True, False]
    assert not number > 1.5 and batch.agree.tolist() == [True, False, False]


def test_scene_with_another_pattern_of_zeros_than_the_first_leaves_the_batch():
    batch = ManyScenes(2)
    assert batch.pattern(np.array([[1.0, 0.0], [2.0, 1e-20]])).tolist() == [True, False]
    assert batch.agree.tolist() == [True, False]


def test_batch_numbers_round_as_python_s():
    values = [0.1234567885, 2.675, math.pi]
    assert round(BatchNumber(np.array(values), ManyScenes(3)), 9).values.tolist() == [
        round(v, 9) for v in values
    ]
