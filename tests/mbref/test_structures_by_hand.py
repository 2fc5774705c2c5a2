"""The structure of a scene / rows, columns, bodies and angles worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from mbref.equations.structure import LoadPlace, Places, PrimitivePlace, structure_of
from mbref.kernels.scene_layout import (
    ABOUT_AXIS,
    ALONG_AXIS,
    COUPLED_ANGLE,
    COUPLED_SLIDE,
    DISTANCE,
    DOT1,
    FORCE,
    POINT,
    SPRING,
)

FRAME = 3  # three bodies
JOINTS = (
    PrimitivePlace(POINT, "A", FRAME, 0, -1),
    PrimitivePlace(DOT1, "A", FRAME, 0, 0),
    PrimitivePlace(DISTANCE, "B", 0, 1, -1),
)
COUPLED = (
    PrimitivePlace(COUPLED_ANGLE, "C", FRAME, 0, -1, 1, "A"),
    PrimitivePlace(COUPLED_SLIDE, "C", 1, 2, -1, 2, "D"),
)
LOADS = (
    LoadPlace(FORCE, 1, 0, -1),
    LoadPlace(ABOUT_AXIS, FRAME, 0, 2),
    LoadPlace(SPRING, 0, 2, -1),
    LoadPlace(ABOUT_AXIS, 1, 2, -1),
    LoadPlace(ALONG_AXIS, 0, 1, 1),
)
WHOLE = structure_of(Places(3, (*JOINTS, *COUPLED), LOADS, (FRAME, 0, 0, 1), (1, 4, 2), 3))


def test_rows_of_joints_and_of_a_coupling():
    """A point has three rows; two coordinates share the row of a coupling."""
    assert WHOLE.row.tolist() == [0, 3, 4, 5, 5] and WHOLE.rows.tolist() == [0, 1, 2, 3, 4, 5]
    assert WHOLE.row_joint == ("A", "A", "A", "A", "B", "C")
    assert WHOLE.kind.tolist() == [POINT, DOT1, DISTANCE, COUPLED_ANGLE, COUPLED_SLIDE]
    assert WHOLE.first.tolist() == [3, 3, 0, 3, 1] and WHOLE.second.tolist() == [0, 0, 1, 0, 2]
    assert WHOLE.driver.tolist() == [-1, 0, -1, -1, -1] and WHOLE.sides == 4
    assert WHOLE.row_bodies.tolist() == [[3, 0, 3, 3]] * 4 + [[0, 1, 3, 3], [3, 0, 1, 2]]
    begins, first, second, angle = WHOLE.places_in_row.tolist()
    assert begins == [1, 1, 1, 1, 0] and first == [0, 0, 0, 0, 12] and second == [6, 6, 6, 6, 18]
    assert angle == [-1, -1, -1, 2, -1], "after the angles of two loads"


def test_a_coupling_of_joints_with_a_common_body():
    """Bodies 0, 1 and 2, and the fixed frame in the fourth place."""
    pair = (
        PrimitivePlace(COUPLED_ANGLE, "C", 0, 1, -1, 1, "A"),
        PrimitivePlace(COUPLED_ANGLE, "C", 1, 2, -1, 2, "B"),
    )
    found = structure_of(Places(3, pair, (), (), (), 1))
    assert found.row_bodies.tolist() == [[0, 1, 2, 3]]
    assert found.places_in_row.tolist() == [[1, 0], [0, 6], [6, 12], [0, 1]]
    assert found.sizes["angles"] == 2 and found.has_angles


def test_an_angle_that_is_the_only_one():
    """The angle of a coupling, or of a load, has the index 0."""
    pair = (
        PrimitivePlace(COUPLED_ANGLE, "C", 0, 1, -1, 1, "A"),
        PrimitivePlace(COUPLED_SLIDE, "C", 1, 2, -1, 2, "B"),
    )
    coupled = structure_of(Places(3, pair, (), (), (), 1))
    assert coupled.places_in_row[3].tolist() == [0, -1] and coupled.angle.size == 0
    loaded = structure_of(Places(3, (), (LoadPlace(ABOUT_AXIS, 0, 1, -1),), (), (), 1))
    assert loaded.angle.tolist() == [0] and loaded.places_in_row.size == 0
    assert coupled.has_angles and loaded.has_angles
    assert coupled.sizes["angles"] == loaded.sizes["angles"] == 1
    neither = structure_of(Places(3, (), (LoadPlace(FORCE, 0, 1, -1),), (), (), 1))
    assert not neither.has_angles


def test_columns_of_blocks():
    columns = WHOLE.entry_columns
    assert columns[4].tolist() == [*range(12), *range(18, 24), *range(18, 24)]
    assert columns[5].tolist() == [*range(18, 24), *range(18)]
    assert WHOLE.of_bodies.tolist() == (columns < 18).tolist() and WHOLE.of_bodies.sum() == 4 * 6 + 12 + 18
    blocks = np.arange(1.0, 6 * 24 + 1).reshape(6, 24)
    dense = WHOLE.dense(blocks)
    assert dense.shape == (6, 18)
    assert dense[0].tolist() == [*range(7, 13), *[0] * 12]
    assert dense[4].tolist() == [*range(97, 109), *[0] * 6]
    assert dense[5].tolist() == [*range(127, 145)]
    assert WHOLE.sparse(blocks).toarray().tolist() == dense.tolist()
    blocks[4, 1] = 0.0
    assert WHOLE.sparse(blocks).nnz == 4 * 6 + 11 + 18
    assert WHOLE.dense(np.stack([blocks, 2 * blocks]))[1].tolist() == (2 * WHOLE.dense(blocks)).tolist()


def test_loads_and_their_angles():
    assert WHOLE.load.tolist() == [
        [FORCE, ABOUT_AXIS, SPRING, ABOUT_AXIS, ALONG_AXIS],
        [1, 3, 0, 1, 0],
        [0, 0, 2, 2, 1],
        [-1, 2, -1, -1, 1],
    ]
    assert WHOLE.angle.tolist() == [-1, 0, -1, 1, -1]
    assert WHOLE.sizes == {
        "nb": 3,
        "n": 18,
        "m": 6,
        "angles": 3,
        "f": 3,
        "dense_rows": 0,
        "sides": 4,
        "width": 24,
    }
    bare = structure_of(Places(3, JOINTS, LOADS[:1], (), (), 1))
    assert not bare.has_angles and bare.sizes["angles"] == 1 and bare.sides == 2 and bare.sizes["width"] == 12
    turning = structure_of(Places(3, JOINTS, LOADS[:2], (), (), 1))
    assert turning.has_angles and turning.sizes["angles"] == 1


def test_bodies_of_vectors():
    """Two points and three directions of a primitive; two points and four directions of a load."""
    of_joints = [(3, 0, 3, 3, 0), (3, 0, 3, 3, 0), (0, 1, 0, 0, 1), (3, 0, 3, 3, 0), (1, 2, 1, 1, 2)]
    of_loads = [
        (1, 0, 1, 1, 1, 0),
        (3, 0, 3, 3, 3, 0),
        (0, 2, 0, 0, 0, 2),
        (1, 2, 1, 1, 1, 2),
        (0, 1, 0, 0, 0, 1),
    ]
    assert WHOLE.vector_body.tolist() == [b for each in (*of_joints, *of_loads) for b in each]
    points = [(3, 0), (3, 0), (0, 1), (3, 0), (1, 2)]
    of_points = [(1, 3), (3, 3), (0, 2), (3, 3), (0, 1)]
    origins = [(*pair, 3, 3, 3) for pair in points] + [(*pair, 3, 3, 3, 3) for pair in of_points]
    assert WHOLE.vector_origin.tolist() == [b for each in origins for b in each]
    marks = [True, True, False, False, False] * 5 + [True, True, False, False, False, False] * 5
    assert WHOLE.vector_is_point.tolist() == marks
    assert WHOLE.anchored.tolist() == [3, 0, 0, 1]
    assert WHOLE.anchor_shares.tolist() == [[0, 0, 0], [0.5, 0, 0], [0.5, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("pairs", "loops"),
    [
        ([("A", 3, 0), ("B", 0, 1)], 0),
        ([("A", 3, 0), ("A", 3, 0), ("B", 0, 1)], 0),
        ([("A", 3, 0), ("B", 0, 1), ("C", 1, 3)], 1),
        ([("A", 3, 0), ("B", 3, 0)], 1),
        ([("A", 0, 1), ("B", 1, 2), ("C", 2, 0), ("D", 2, 3), ("E", 3, 0)], 2),
        ([], 0),
    ],
)
def test_independent_loops(pairs, loops):
    """Several rows of one joint count once, couplings do not count."""
    primitives = tuple(PrimitivePlace(DOT1, *pair, -1) for pair in pairs)
    assert structure_of(Places(3, primitives, (), (), (), 1)).closed_loops == loops
    assert structure_of(Places(3, (*primitives, *COUPLED), (), (), (), 1)).closed_loops == loops
