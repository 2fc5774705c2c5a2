"""Products of series, rows of joints and parts of offsets / tables and counts worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from mbref.design import offsets
from mbref.equations.initial_state import consistent_start
from mbref.equations.model import Model
from mbref.kernels.records import NoNumbers, is_record
from mbref.scene import (
    Body,
    Cylindrical,
    Distance,
    Fixed,
    Planar,
    Revolute,
    Scene,
    Spherical,
    Translational,
    Universal,
)
from mbref.taylor.expressions import ONE
from mbref.taylor.polynomials import _products
from tests.coupled_scenes import gear_pair


@pytest.mark.parametrize("driven", [False, True])
def test_products_of_a_row_and_of_its_forces(driven):
    """The row 3 x² + 5 x y + 4 x f + 2 x of variables x, y and a function f; with drivers no forces."""
    row = {(7, 7): 3.0, (7, 8): 5.0, (7, 9): 4.0, (ONE, 7): 2.0}
    of: Any = SimpleNamespace(kept=[7, 8], rows=[row], driven=driven)
    found = _products(of, {7: 0, 8: 1, 9: 3}, 8)
    lanes: list[list[tuple[int, int, float]]] = [[] for _ in range(8)]
    for slot, term in enumerate(
        zip(found.left.tolist(), found.right.tolist(), found.weight.tolist(), strict=True)
    ):
        if term[2]:
            lanes[slot % 8].append(term)
    assert lanes[2] == [(0, 0, 3.0), (0, 1, 5.0), (0, 3, 4.0)]
    forces = [[(2, 0, 6.0), (2, 1, 5.0), (2, 3, 4.0)], [(2, 0, 5.0)]]
    assert lanes[:2] == ([[], []] if driven else forces) and not any(lanes[3:])
    assert found.start.tolist() == [0, 24] and found.weight.size == 24


def every_type() -> Scene:
    """Bodies beside each other, each on a joint of another type."""
    x, y, z = np.eye(3).tolist()
    at = {"anchor": (0.0, 0.0, 0.0)}
    kinds: list[Any] = [
        lambda **k: Revolute(axis=z, **at, **k),
        lambda **k: Universal(axes=(x, z), **at, **k),
        lambda **k: Spherical(**at, **k),
        lambda **k: Translational(axis=x, **at, **k),
        lambda **k: Cylindrical(axis=y, **at, **k),
        lambda **k: Planar(axis=z, **at, **k),
        lambda **k: Fixed(**at, **k),
        lambda **k: Distance(anchors=((0.0, 0.0, 0.0), (1.0, 0.5, 0.3)), **k),
    ]
    place = {"mass": 1.0, "inertia": (0.1, 0.2, 0.25)}
    names = [f"b{k}" for k in range(len(kinds))]
    bodies = [Body(name=name, position=(0.3 * k, 0.1, -0.2), **place) for k, name in enumerate(names)]
    joints = [make(name=f"J{k}", bodies=("ground", names[k])) for k, make in enumerate(kinds)]
    joints.append(Revolute(name="pair", bodies=("b0", "b1"), axis=y, anchor=(0.2, 0.4, 0.1)))
    return Scene(name="every", body=tuple(bodies), joint=tuple(joints))


def test_an_evaluation_overwrites_all_entries_that_are_not_zero():
    model = Model(every_type())
    q, v = consistent_start(model).q, np.sin(np.arange(1.0, model.n + 1))
    before = model.terms(0.0, q, v)
    first = before.blocks.copy(), before.phi.copy(), before.nu.copy(), before.gamma.copy()
    values = model.memory.values
    values.system.blocks[values.system.blocks != 0.0] = 7.0
    for name in ("phi", "gamma"):
        getattr(values.rows, name)[...] = 7.0
    after = model.terms(0.0, q, v)
    for one, other in zip(first, (after.blocks, after.phi, after.nu, after.gamma), strict=True):
        assert one.tolist() == other.tolist()
    model.release()


def test_an_offset_is_divided_until_a_part_is_small_or_there_are_too_many(monkeypatch):
    [coupling] = gear_pair().coupling
    scene = gear_pair().with_(coupling=[coupling.model_copy(update={"offset": 0.01})])
    solved: list[np.ndarray] = []
    solve = offsets.solve_positions

    def counted(model: Any, t: float, q: np.ndarray, value: np.ndarray) -> Any:
        solved.append(np.abs(value).max())
        return solve(model, t, q, value)

    monkeypatch.setattr(offsets, "solve_positions", counted)
    monkeypatch.setattr(offsets, "MOST_PARTS", 4)
    whole = 0.01 / max(1.0, abs(coupling.ratio))
    for small, parts in ((lambda *_: False, 4), (lambda scene, value: np.abs(value).max() < 0.6 * whole, 2)):
        solved.clear()
        monkeypatch.setattr(offsets, "_is_small", small)
        offsets.assembled.__wrapped__(scene)
        assert solved == pytest.approx([whole / parts] * parts)


class Mixed(NamedTuple):
    count: int
    line: np.ndarray


def test_a_record_has_numbers_alone():
    assert is_record(NoNumbers) and not is_record(Mixed)
