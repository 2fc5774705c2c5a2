"""The spanning tree of the reference / rates and second rates against differences along a path.

Joint coordinates grow at constant rates, so that the second rate of each quantity is its drift.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.reference.tree_equations import Instant, TreeEquations
from mbref.scene import JOINT_TYPES, Body, Driver, Revolute, Scene

H = 1e-4  # s; errors of differences are about 1e-8
AXIS, ACROSS = (0.2, -0.3, 1.0), (0.6, 0.4, 0.0)


def body(name: str, *place: float) -> Body:
    return Body(name=name, mass=1.0, inertia=(1.0, 2.0, 2.5), position=place)


def joint(name: str, kind: str, bodies: tuple[str, str], place: tuple[float, ...], axis: Any = AXIS) -> Any:
    """A joint at a place, with an axis and a second one across it."""
    axes, ends = (axis, tuple(np.cross(axis, ACROSS).tolist())), (place, (0.3, 1.4, -0.6))
    return JOINT_TYPES[kind].at(name, bodies, anchor=place, anchors=ends, axis=axis, axes=axes)


def scene(carrying: str, *cut: Any) -> Scene:
    """The ground carries a by a driven hinge, and a carries b by a joint of a type."""
    foot = Revolute(name="A", bodies=("ground", "a"), anchor=(0.1, 0.0, 0.2), axis=(0.0, 0.6, 0.8))
    between = joint("B", carrying, ("b", "a"), (1.0, 0.5, 0.1))
    return Scene(
        name="s",
        body=(body("a", 0.6, 0.2, -0.1), body("b", 1.5, 0.9, 0.4)),
        joint=(foot, between, *cut),
        driver=(Driver(joint="A", polynomial=(0.0, 0.3)),),
    )


def along(of: Scene) -> tuple[TreeEquations, Instant, np.ndarray]:
    """The parts of the equations at three times of a path, and the joint rates."""
    equations = TreeEquations(of, DOUBLE)
    count = equations.tree.scalars
    assert count == equations.nv and not equations.tree.balls
    place, rate = 0.4 + 0.3 * np.arange(count), np.resize([0.7, -1.1, 0.9, 1.3], count)
    y = np.zeros((3, int(equations.ends[-1])))
    y[:, :count] = place + H * np.array([[-1.0], [0.0], [1.0]]) * rate
    y[:, equations.ends[2] :] = rate
    return equations, equations.at(np.zeros(3), y), rate


def slope(values: np.ndarray) -> np.ndarray:
    return (values[2] - values[0]) / (2 * H)


def second(values: np.ndarray) -> np.ndarray:
    return (values[2] - 2 * values[1] + values[0]) / H**2


@pytest.mark.parametrize("kind", ["revolute", "cylindrical", "translational", "planar", "universal", "fixed"])
def test_motion_of_bodies_on_a_tree(kind):
    _, at, rate = along(scene(kind))
    placed = at.placed
    assert placed.velocity[1] == pytest.approx(slope(placed.position), abs=1e-7)
    assert placed.drift[1] == pytest.approx(slope(placed.velocity), abs=1e-7)
    assert placed.spin_drift[1] == pytest.approx(slope(placed.spin), abs=1e-7)
    turning = slope(placed.rotation) @ np.swapaxes(placed.rotation[1], -1, -2)
    spin = np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1)
    assert placed.spin[1] == pytest.approx(spin, abs=1e-7)
    twists = np.einsum("bvi,v->bi", placed.columns[1], rate)
    assert twists == pytest.approx(np.hstack([placed.velocity[1], placed.spin[1]]), abs=1e-12)
    assert not placed.position[:, 2].any() and not placed.columns[:, 2].any(), "the ground is at rest"


CUT = [kind for kind in JOINT_TYPES if kind != "revolute"]


@pytest.mark.parametrize("bodies", [("ground", "b"), ("b", "a")])
@pytest.mark.parametrize("kind", CUT)
def test_rows_of_closures(kind, bodies):
    """Values of the rows, their Jacobian and their drift; joints are closed at the start."""
    closing = joint("C", kind, bodies, (1.8, 1.0, 0.3), (1.0, 0.5, -0.4))
    of = scene("revolute", closing)
    of = of.with_(driver=(*of.driver, Driver(joint="B", polynomial=(0.0, 0.2))))
    equations, at, rate = along(of)
    assert [link.joint.name for link in equations.tree.links] == ["A", "B"]
    assert [cut.name for cut in equations.tree.cut] == ["C"]
    count = at.rows.value.shape[1] - 2
    assert count == len(equations.closures.sizes(1.0)) > 0 and np.abs(at.rows.value[1, :count]).max() > 1e-3
    speed = at.rows.jacobian[1, :count] @ rate
    assert slope(at.rows.value)[:count] == pytest.approx(speed, abs=1e-7)
    assert at.speed[1, :count] == pytest.approx(speed)
    assert second(at.rows.value)[:count] == pytest.approx(at.rows.drift[1, :count], abs=1e-6)
    still = equations.at(np.zeros(1), np.zeros((1, int(equations.ends[-1]))))
    assert still.rows.value[0] == pytest.approx(np.zeros(count + 2), abs=1e-15)
