"""Diagnosis along a motion, assembly, equilibria and linearisation / numbers worked out by hand."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import rotations
from mbref.design import along_motion, assemble, equilibrium, exchange, linearisation, offsets, placed
from mbref.design.along_motion import AlongMotion
from mbref.design.linearisation import OffConstraints, Tangent
from mbref.design.turning import Turning
from mbref.equations.model import Model
from mbref.scene import (
    Body,
    Coupling,
    Distance,
    Driver,
    Factor,
    Moment,
    Revolute,
    Scene,
    SceneError,
    Translational,
)
from mbref.trajectory import Outcome

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
BAR = Body(name="bar", mass=2.0, inertia=(0.1, 0.2, 0.3), position=(1.0, 0.0, 0.0))
HINGE = Revolute(name="A", bodies=("ground", "bar"), anchor=(0.0, 0.0, 0.0), axis=Z)
DOOR = Scene(name="door", body=(BAR,), joint=(HINGE,), gravity=(0.0, -10.0, 0.0), duration=2.0)


# --- along a motion -----------------------------------------------------------------------------------------
def moved(**changes: Any) -> Any:
    """A motion of 5 samples of one body that moves by 1 m of a mechanism of 10 m."""
    position = np.zeros((5, 1, 3))
    position[:, 0, 0] = np.linspace(0.0, 1.0, 5)
    parts = {"times": np.linspace(0.0, 2.0, 5), "position": position, "orientation": np.ones((5, 1, 4))}
    parts |= {"crossings": None, "outcome": Outcome.COMPLETED, "message": "why"}
    return SimpleNamespace(**{**parts, **changes})


def summary(monkeypatch: pytest.MonkeyPatch, values: Any, **changes: Any) -> AlongMotion:
    monkeypatch.setattr(along_motion, "_is_shaky", lambda *_: False)
    model: Any = SimpleNamespace(length=10.0, m=4)
    return along_motion._summary(model, moved(**changes), np.array(values))


def test_ranks_along_a_motion(monkeypatch):
    """The rank is 2 at most poses; a value of 1e-9 is rounding, and one of 1e-11 is zero."""
    values = [
        [1.0, 0.5, 1e-9, 1e-11],
        [1.0, 0.2, 2e-9, 0.0],
        [1.0, 0.2 * (1 + 1e-10), 0, 0],
        [1.0, 0.3, 0, 0],
    ]
    found = summary(monkeypatch, [*values, [1.0, 0.4, 0.0, 0.0]])
    assert (found.rank, found.redundant, found.by_rounding) == (2, 2, (2e-9,))
    assert (found.nearest, found.nearest_time, found.end) == (0.2, 0.5, 2.0)
    assert found.moves is True and found.crossings == () and found.stopped == "" and found.shaky is False


def test_a_motion_without_rows_and_a_motion_that_stops(monkeypatch):
    free = summary(monkeypatch, np.zeros((5, 0)), outcome=Outcome.STEP_FAILED, crossings=("one",))
    assert (free.rank, free.redundant, free.nearest, free.nearest_time) == (0, 4, 0.0, 0.0)
    assert free.by_rounding == () and free.stopped == "why" and free.crossings == ("one",)


@pytest.mark.parametrize(
    ("shift", "turn", "moves"),
    [(0.0, 0.0, False), (1.1e-8, 0.0, True), (0.9e-8, 0.0, False), (0.0, 1.1e-9, True)],
)
def test_a_motion_that_stays_at_its_place(monkeypatch, shift, turn, moves):
    """Shifts are relative to the mechanism's length of 10 m."""
    position, orientation = np.zeros((5, 2, 3)), np.zeros((5, 2, 4))
    position[1, 1, 2], orientation[1, 1, 2] = shift, turn
    found = summary(monkeypatch, np.zeros((5, 0)), position=position, orientation=orientation)
    assert found.moves is moves


def test_the_relative_singular_values_of_poses(monkeypatch):
    asked: list[Any] = []
    rows = {0.0: np.diag([4.0, 1.0]), 1.0: np.diag([0.5, 2.0])}
    monkeypatch.setattr(along_motion, "poses", lambda *given: asked.append(given) or ["q0", "q1"])
    monkeypatch.setattr(along_motion, "scaled_jacobian", lambda model, t, q: asked.append((t, q)) or rows[t])
    model: Any = "model"
    found = along_motion._singular_values(model, np.array([0.0, 1.0]), "position", "orientation")  # type: ignore[arg-type]
    assert found.tolist() == [[1.0, 0.25], [1.0, 0.25]]
    assert asked == [("model", "position", "orientation"), (0.0, "q0"), (1.0, "q1")]
    monkeypatch.setattr(along_motion, "scaled_jacobian", lambda *_: np.zeros((0, 6)))
    assert along_motion._singular_values(model, np.zeros(2), "p", "o").shape == (2, 0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("m", "loops", "forms", "shaky"),
    [
        (9, 1, [[1], [1], [2], [1], [1]], True),
        (9, 1, [[1], [1], [], [1], [1]], False),
        (9, 0, [[1]] * 5, False),
        (along_motion.MOST_BRANCHED, 1, [[1]] * 5, True),
        (along_motion.MOST_BRANCHED + 1, 1, [[1]] * 5, False),
    ],
)
def test_velocities_that_equations_of_second_order_forbid(monkeypatch, m, loops, forms, shaky):
    """Five poses from the first to the last of eleven samples, at rest."""
    asked: list[Any] = []

    def second(model: Any, t: float, q: Any, v: np.ndarray) -> Any:
        asked.append((t, q, v.tolist()))
        return SimpleNamespace(forms=forms[len(asked) - 1])

    monkeypatch.setattr(along_motion, "second_order", second)
    monkeypatch.setattr(along_motion, "poses", lambda model, position, orientation: position)
    motion: Any = SimpleNamespace(times=np.arange(11.0), position=np.arange(11.0), orientation=np.zeros(11))
    model: Any = SimpleNamespace(m=m, closed_loops=loops, n=2)
    assert along_motion._is_shaky(model, motion) is shaky
    if shaky:
        assert asked == [(float(t), float(t), [0.0, 0.0]) for t in (0, 2, 5, 8, 10)]


def test_the_motion_that_is_diagnosed(monkeypatch):
    """A motion without samples begins again with another rank tolerance, and may still not begin."""
    asked: list[Any] = []
    empty, full = moved(times=np.zeros(0), message="locked"), moved()

    def simulate(scene: Scene, method: Any, times: np.ndarray, limits: Any) -> Any:
        asked.append((scene.name, method, len(times), times[-1], limits.most_steps, limits.rank_tolerance))
        return left.pop(0)

    monkeypatch.setattr(along_motion, "simulate", simulate)
    monkeypatch.setattr(along_motion, "_singular_values", lambda *given: given[1:])
    monkeypatch.setattr(along_motion, "_summary", lambda model, motion, values: (motion, values))
    left = [full]
    found: Any = along_motion.along_motion(DOOR)
    assert found[0] is full and [len(each) for each in found[1]] == [5, 5, 5]
    left = [empty, full]
    assert along_motion.along_motion(DOOR)[0] is full  # type: ignore[index]
    usual = asked[0][5]
    assert (
        asked
        == [
            ("door", None, 61, 2.0, 20_000, usual),
            ("door", None, 61, 2.0, 20_000, usual),
            ("door", None, 61, 2.0, 20_000, along_motion.NEARLY),
        ]
        and usual != along_motion.NEARLY
    )
    left = [empty, empty]
    with pytest.raises(SceneError, match="scene: the motion could not begin: locked"):
        along_motion.along_motion(DOOR)


def test_a_scene_with_many_rows_is_not_diagnosed(monkeypatch):
    for m, refused in ((300, False), (301, True)):
        monkeypatch.setattr(along_motion, "Model", lambda scene, m=m: SimpleNamespace(m=m))
        monkeypatch.setattr(along_motion, "simulate", lambda *_: moved())
        monkeypatch.setattr(along_motion, "_singular_values", lambda *_: None)
        monkeypatch.setattr(along_motion, "_summary", lambda *_: "found")
        if refused:
            with pytest.raises(SceneError, match="301 constraint rows are too many"):
                along_motion.along_motion(DOOR)
        else:
            assert along_motion.along_motion(DOOR) == "found"


# --- assembly -----------------------------------------------------------------------------------------------
RODS = Scene(
    name="rods",
    body=(BAR, BAR.model_copy(update={"name": "rod", "position": (3.0, 0.0, 0.0)})),
    joint=(
        HINGE,
        Revolute(name="B", bodies=("bar", "rod"), anchor=(2.0, 0.0, 0.0), axis=Z),
        Distance(name="D", bodies=("rod", "ground"), anchors=((4.0, 0.0, 0.0), (4.0, 3.0, 0.0))),
    ),
)


def test_anchors_on_a_body_and_distances_between_them():
    assert assemble._anchor(RODS, "D", "rod") == (4.0, 0.0, 0.0)
    assert assemble._anchor(RODS, "D", "ground") == (4.0, 3.0, 0.0)
    assert assemble._apart(RODS, "B", "D", "rod") == 2.0 and assemble._apart(RODS, "A", "D", "ground") == 5.0


def test_shifts_of_the_points_of_links():
    """The bar of 2 m grows by 0.4 m, half at each end; the ground between A and D stays."""
    pairs = {("A", "B"): "bar", ("D", "A"): "ground"}
    found = assemble._shifts(RODS, {("A", "B"): 2.4, ("D", "A"): 5.0}, pairs)
    ends = {"bar": [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)], "ground": [(0.0, 0.0, 0.0), (4.0, 3.0, 0.0)]}
    assert set(found) == {(body, point) for body, points in ends.items() for point in points}
    assert found["bar", (0.0, 0.0, 0.0)] == pytest.approx([-0.2, 0.0, 0.0])
    assert found["bar", (2.0, 0.0, 0.0)] == pytest.approx([0.2, 0.0, 0.0])
    assert not found["ground", (4.0, 3.0, 0.0)].any()


def test_points_of_a_reshaped_scene_move_with_their_body():
    """The point of the bar at B moves by 0.2 m, and the point of the rod at B stays."""
    elsewhere = {("bar", (2.0, 0.0, 0.0)): np.array([2.2, 0.0, 0.0])}
    model = Model(RODS, assemble._Reshaped(RODS, elsewhere))
    phi = model.terms(0.0, model.start()).phi
    usual = Model(RODS)
    assert not usual.terms(0.0, usual.start()).phi.any()
    assert [usual.row_joint[r] for r in np.flatnonzero(phi)] == ["B"] and np.abs(phi).max() == pytest.approx(
        0.2
    )


def test_an_assembly_in_twenty_parts(monkeypatch):
    """A share of the shift is added at a time; loops that stay open are told with the share."""
    shares: list[float] = []
    q = np.zeros(14)

    def solve(model: Any, t: float, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        shares.append(float(model.elsewhere["bar", (0.0, 0.0, 0.0)][0]))
        return start, np.array([0.0, opens if len(shares) == 5 else 0.0])

    monkeypatch.setattr(assemble, "_shifts", lambda *_: {("bar", (0.0, 0.0, 0.0)): np.array([2.0, 0.0, 0.0])})
    monkeypatch.setattr(assemble, "_Reshaped", lambda scene, elsewhere: elsewhere)
    monkeypatch.setattr(
        assemble,
        "Model",
        lambda scene, elsewhere=None: SimpleNamespace(
            start=lambda: q, elsewhere=elsewhere, length=4.0, row_joint=["A", "B"]
        ),
    )
    monkeypatch.setattr(assemble, "solve_positions", solve)
    monkeypatch.setattr(assemble, "placed", lambda model, q: RODS)
    opens = 4e-10
    found = assemble.assemble(RODS, {("A", "B"): 2.0})
    assert shares == pytest.approx(np.arange(1, 21) / 10) and found.lengths == {"A–B": (2.0, 2.0)}
    shares.clear()
    opens = -4.1e-10
    with pytest.raises(SceneError) as refused:
        assemble.assemble(RODS, {("A", "B"): 2.0})
    assert str(refused.value) == (
        "joint[B]: the loops cannot be closed with these lengths; at 25 % of the changes 4.1e-10 remains open"
    )


def test_differences_of_an_assembled_scene():
    turned = tuple(rotations.from_vector(np.array([0.0, 0.0, 0.3])).tolist())
    body = BAR.model_copy(update={"position": (1.0, 3.0, 4.0), "orientation": turned})
    joints = (
        RODS.joint[0],
        RODS.joint[1].model_copy(update={"anchor": (2.0, 0.5, 0.0)}),
        RODS.joint[2].model_copy(update={"anchors": ((4.0, 0.1, 0.0), (4.0, 3.2, 0.0))}),
    )
    found = assemble._compared(RODS, RODS.with_(body=(body, RODS.body[1]), joint=joints), {("B", "D"): "rod"})
    assert found.bodies == {"bar": (5.0, pytest.approx(0.3)), "rod": (0.0, 0.0)}
    assert found.joints == {"A": 0.0, "B": 0.5, "D": pytest.approx(0.2)}
    assert found.lengths == {"B–D": (2.0, pytest.approx(math.hypot(2.0, 0.4)))}


# --- linearisation ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("power", "slope"), [(1, 3.0), (2, 0.0), (3, 0.0), (5, 0.0), (7, 0.0), (8, 0.0)])
def test_differences_of_order_eight_are_exact_for_polynomials(power, slope):
    """The slope at zero of 3 x, x², …, x⁸, along a direction of length 2."""
    made = Tangent.__new__(Tangent)
    made.step = 0.5
    factor = 3.0 if power == 1 else 1.0
    found = made._derivative(lambda y: factor * y**power, np.array([2.0]))
    assert found == pytest.approx([2 * slope], abs=1e-12)


def tangent(model: Model, frame: Turning | None = None) -> Tangent:
    return Tangent(model, model.start(), frame or Turning(np.zeros(3), np.zeros(3), ""))


def test_coordinates_of_a_door():
    """Upright, gravity turns the door: one coordinate whose motion is 1 m along y for 1 rad about z."""
    made = tangent(Model(DOOR))
    length = made.model.length
    assert made.freedoms == 1 and length == pytest.approx(1.0)
    assert made.units == pytest.approx([1.0] * 3 + [1 / length] * 3)
    assert abs(made.basis[[1, 5], 0]) == pytest.approx([math.sqrt(0.5)] * 2) and made.step == pytest.approx(
        0.005
    )
    angle = 0.1
    q = made.pose(np.array([angle * math.sqrt(2.0)]) * np.sign(made.basis[1, 0]))
    turned = math.atan2(q[1], q[0])
    assert math.hypot(q[0], q[1]) == pytest.approx(1.0, abs=1e-9) and turned == pytest.approx(angle, abs=1e-3)
    # 2 kg · 10 m/s² · 1 m on 2.3 kg m² about the hinge
    rest = made.accelerations(np.zeros(1), np.zeros(1))
    assert rest[0] == pytest.approx(-20 / 2.3 * math.sqrt(2.0) * np.sign(made.basis[1, 0]))


def hanging() -> Scene:
    """The door hangs from its hinge, with a damper: θ'' = -20 / 2.3 θ - 0.46 / 2.3 θ'."""
    down = (0.0, -1.0, 0.0)
    turned = tuple(rotations.from_vector(np.array([0.0, 0.0, -math.pi / 2])).tolist())
    damper = {"type": "torsion_spring", "joint": "A", "stiffness": 0.0, "damping": 0.46}
    body = BAR.model_copy(update={"position": down, "orientation": turned})
    return DOOR.with_(body=(body,), load=(damper,))


def test_the_linear_part_and_the_slope_of_a_hanging_door():
    made = tangent(Model(hanging()))
    by_place, by_rate = made.linear_part()
    assert by_place == pytest.approx(np.array([[-20 / 2.3]]), rel=1e-9)
    assert by_rate == pytest.approx(np.array([[-0.2]]), rel=1e-9)
    assert made.slope() == pytest.approx(np.array([[-20 / 2.3]]), rel=1e-6)
    force = linearisation.multipliers(made)
    left = Model(hanging()).terms(0.0, made.q)
    assert left.jacobian.T @ force == pytest.approx(left.force, abs=1e-9)


def test_accelerations_of_what_rows_allow():
    """Rows (1, 1) with γ = 4 of masses 1 and 3 under (2, 6): M a = f - Gᵀ λ with a₀ + a₁ = 4."""
    terms = SimpleNamespace(
        jacobian=np.array([[1.0, 1.0]]),
        gamma=np.array([4.0]),
        mass=np.array([1.0, 3.0]),
        force=np.array([2.0, 6.0]),
    )
    model: Any = SimpleNamespace(terms=lambda *_: terms, n=2, m=1)
    found = linearisation.accelerations(model, 0.0, np.zeros(7), np.zeros(2))
    assert found == pytest.approx([2.0, 2.0]) and found.sum() == pytest.approx(4.0)
    free = SimpleNamespace(**{**vars(terms), "jacobian": np.zeros((0, 2)), "gamma": np.zeros(0)})
    model = SimpleNamespace(terms=lambda *_: free, n=2, m=0)
    assert linearisation.accelerations(model, 0.0, np.zeros(7), np.zeros(2)) == pytest.approx([2.0, 2.0])


def test_poses_off_the_constraints(monkeypatch):
    made = tangent(Model(DOOR))
    off = 0.99e-10
    monkeypatch.setattr(linearisation, "solve_positions", lambda model, t, q: (q, None))
    made.model = SimpleNamespace(length=0.5, terms=lambda t, q: SimpleNamespace(phi=np.array([0.0, -off])))  # type: ignore[assignment]
    made.pose(np.zeros(1))
    off = 1.01e-10
    with pytest.raises(OffConstraints):
        made.pose(np.zeros(1))
    made.model.length = 2.0
    made.pose(np.zeros(1))


@pytest.mark.parametrize(
    ("rate", "freedoms", "phi", "change", "found"),
    [
        (3.0, 1, 1.9e-9, 0.9e-9, ""),
        (3.0, 1, 2.1e-9, 0.0, "joint 'B' does not turn with it"),
        (3.0, 1, 0.0, 1.1e-9, "the loads change while it turns"),
        (0.0, 1, 1.0, 1.0, ""),
        (3.0, 0, 1.0, 1.0, ""),
    ],
)
def test_motions_that_are_not_steady(monkeypatch, rate, freedoms, phi, change, found):
    """A displaced pose is compared with itself after a turn by 1 rad; a mechanism of 2 m."""
    asked: list[Any] = []

    def accelerations(model: Any, t: float, q: Any, v: Any) -> np.ndarray:
        asked.append((t, q, v))
        return np.array([1.0, 0.5 + (change if t else 0.0)])

    monkeypatch.setattr(linearisation, "accelerations", accelerations)
    frame = SimpleNamespace(
        rate=rate,
        velocities=lambda model, q: ("now", q),
        turned=lambda model, q, angle: ("later", q, angle),
        turned_rates=lambda model, v, angle: v if isinstance(v, np.ndarray) else ("rates", v, angle),
    )
    model = SimpleNamespace(
        length=2.0, row_joint=["A", "B"], terms=lambda t, q, v: SimpleNamespace(phi=np.array([0.0, -phi]))
    )
    made: Any = SimpleNamespace(
        model=model, frame=frame, freedoms=freedoms, step=0.25, q="q0", pose=lambda y: ("moved", y.tolist())
    )
    assert linearisation.unsteady(made) == found
    if rate and freedoms and not phi > 2e-9:
        q = ("moved", [0.25])
        assert asked == [
            (0.0, q, ("now", q)),
            (pytest.approx(1 / 3), ("later", q, 1.0), ("rates", ("now", q), 1.0)),
        ]

    def off(y: np.ndarray) -> None:
        raise OffConstraints

    if found == "" and rate and freedoms:
        made.pose = off
        asked.clear()
        assert linearisation.unsteady(made) == "" and asked[0][1] == "q0"


# --- equilibria ---------------------------------------------------------------------------------------------
class Slope:
    """Coordinates y near an equilibrium at y = ``zero``, with accelerations -k (y - zero)."""

    def __init__(self, y: np.ndarray, zero: np.ndarray, k: np.ndarray, off: float = math.inf) -> None:
        self.y, self.zero, self.k, self.off = y, zero, k, off
        self.q = np.concatenate([[*y, 0.0, 0.0, 0.0][:3], [1.0, 0.0, 0.0, 0.0]])
        self.units, self.model = np.ones(6), SimpleNamespace(length=2.0)
        self.freedoms, self.basis, self.frame = y.size, np.eye(y.size), None

    def accelerations(self, y: np.ndarray, rate: np.ndarray) -> np.ndarray:
        assert not y.any() and not rate.any() and y.size == rate.size == self.freedoms
        return -self.k @ (self.y - self.zero)

    def slope(self) -> np.ndarray:
        return -self.k

    def to(self, y: np.ndarray) -> Any:
        made = Slope(self.y + y, self.zero, self.k, self.off)
        return None if np.abs(made.y).max() > self.off else made


@pytest.fixture
def moving(monkeypatch: pytest.MonkeyPatch) -> list[np.ndarray]:
    """Moves of coordinates, which are noted."""
    moves: list[np.ndarray] = []

    def to(tangent: Slope, y: np.ndarray) -> Any:
        moves.append(y)
        return tangent.to(y)

    monkeypatch.setattr(equilibrium, "_moved", to)
    return moves


STIFF = np.array([[2.0, 0.5], [0.5, 1.0]])


def test_an_equilibrium_is_found_by_newton_steps_of_limited_length(moving):
    """Steps are at most 0.3 · 2 m long; the last one refines."""
    start = Slope(np.array([1.0, -1.0]), np.array([0.2, 0.4]), STIFF)
    found = equilibrium._balanced(start, 1.0)  # type: ignore[arg-type]
    assert found is not None and found.y == pytest.approx([0.2, 0.4], abs=1e-11)  # type: ignore[attr-defined]
    sizes = [np.linalg.norm(move) for move in moving]
    assert sizes[:2] == pytest.approx([0.6, 0.6]) and sizes[2] < 0.6
    assert moving[0] == pytest.approx(0.6 * np.array([-0.8, 1.4]) / math.hypot(0.8, 1.4))


def test_an_equilibrium_beyond_the_constraints_is_not_found(moving):
    """Steps that leave the constraints grow the damping from 1e-3 to 1e6, tenfold each."""
    start = Slope(np.array([1.0, 1.0]), np.array([2.0, 1.0]), STIFF, off=1.0)
    assert equilibrium._balanced(start, 1.0) is None  # type: ignore[arg-type]
    assert len(moving) == 11 and np.linalg.norm(moving[-1]) < 1e-5


def test_damped_steps_towards_an_equilibrium(moving):
    """One coordinate, 1 m from its equilibrium: the damped step is 1 m / (1 + damping), at most 0.6 m."""
    start = Slope(np.array([1.0]), np.array([2.0]), np.array([[3.0]]), off=1.0)
    assert equilibrium._balanced(start, 1.0) is None  # type: ignore[arg-type]
    damping = np.array([0.0, *10.0 ** np.arange(-3, 7)])
    assert np.array(moving)[:, 0] == pytest.approx(np.minimum(0.6, 1 / (1 + damping)))
    moving.clear()
    start.off = 1.07
    assert equilibrium._balanced(start, 1.0) is None  # type: ignore[arg-type]
    left = 1.0 - 1 / 101
    steps = [0.6, 0.6, 0.6, 0.6, 0.5, 1 / 11, 1 / 101, left / 11, left / 101]
    assert np.array(moving)[:9, 0] == pytest.approx(np.array(steps)), "a step of damping 100 is taken first"


def test_a_pose_whose_slope_leaves_the_constraints_is_no_equilibrium(moving):
    start = Slope(np.array([1.0, 1.0]), np.array([2.0, 1.0]), STIFF)

    def off() -> np.ndarray:
        raise OffConstraints

    start.slope = off  # type: ignore[method-assign]
    assert equilibrium._balanced(start, 1.0) is None  # type: ignore[arg-type]
    assert equilibrium._refined(start, np.ones(2)) is start  # type: ignore[arg-type, comparison-overlap]


def test_a_refined_equilibrium_is_taken_if_it_is_better(moving):
    start = Slope(np.array([0.2 + 1e-12, 0.4]), np.array([0.2, 0.4]), STIFF)
    off = start.accelerations(np.zeros(2), np.zeros(2))
    found: Any = equilibrium._refined(start, off)  # type: ignore[arg-type]
    assert found is not start and found.y == pytest.approx([0.2, 0.4], abs=1e-15)
    assert equilibrium._refined(start, 1e-9 * off) is start  # type: ignore[arg-type, comparison-overlap]
    start.off = 0.1
    assert equilibrium._refined(start, off) is start  # type: ignore[arg-type, comparison-overlap]


def test_starts_go_forth_and_back_along_one_direction(moving):
    """Steps of 0.35 · 2 m of one coordinate, forth and back in turn, from the first pose on."""
    first = Slope(np.array([0.1]), np.zeros(1), np.eye(1))
    found: Any = list(equilibrium._starts(first, 6))  # type: ignore[arg-type]
    places = np.array([each.y[0] for each in found]) - 0.1
    sign = np.sign(places[1])
    assert found[0] is first and places * sign == pytest.approx([0.0, 0.7, -0.7, 1.4, -1.4, 2.1])


def test_starts_that_leave_the_constraints_are_left_out(moving):
    first = Slope(np.array([0.0]), np.zeros(1), np.eye(1), off=1.0)
    found: Any = list(equilibrium._starts(first, 6))  # type: ignore[arg-type]
    assert len(moving) == 5 and 1 < len(found) < 6 and all(abs(each.y[0]) <= 1.0 for each in found)


def test_directions_of_starts_turn_a_little(moving):
    first = Slope(np.zeros(2), np.zeros(2), np.eye(2))
    list(equilibrium._starts(first, 6))  # type: ignore[arg-type]
    directions = np.array(moving) / 0.7
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(5))
    along = [a @ b for a, b in itertools.pairwise(directions)]
    assert all(-1.0 < cosine < -0.4 for cosine in along), "back nearly against the direction forth"


def test_the_scale_of_accelerations():
    """√(2² + ½² + ½² + 1²) 2 m, or the largest acceleration at a pose."""
    near = Slope(np.array([0.1, 0.0]), np.zeros(2), STIFF)
    far = Slope(np.array([10.0, 0.0]), np.zeros(2), STIFF)
    assert equilibrium._scale([near]) == pytest.approx(2 * math.sqrt(5.5))  # type: ignore[list-item]
    assert equilibrium._scale([near, far]) == pytest.approx(10 * math.hypot(2.0, 0.5))  # type: ignore[list-item]


def test_different_equilibria_in_the_order_in_which_they_are_found(monkeypatch):
    made = {"a": 1.0, "b": None, "c": 1.0, "d": 2.0}
    monkeypatch.setattr(equilibrium, "Tangent", lambda model, q, frame: "first")
    monkeypatch.setattr(equilibrium, "unsteady", lambda first: reason)
    monkeypatch.setattr(equilibrium, "_starts", lambda first, count: list("abcd")[:count])
    monkeypatch.setattr(equilibrium, "_scale", lambda poses: scale)
    monkeypatch.setattr(equilibrium, "_balanced", lambda pose, scale: made[pose])
    monkeypatch.setattr(equilibrium, "_is_same", lambda one, other: one == other)
    monkeypatch.setattr(equilibrium, "_equilibrium", lambda tangent: ("at", tangent))
    reason, scale = "", 1.0
    assert equilibrium.equilibria(DOOR, 4) == [("at", 1.0), ("at", 2.0)]
    assert equilibrium.equilibria(DOOR, 1) == [("at", 1.0)] and equilibrium.equilibria(DOOR, 2) == [
        ("at", 1.0)
    ]
    length = Model(DOOR).length
    scale = 0.99e-9 * length / 4.0
    assert equilibrium.equilibria(DOOR, 4) == [("at", "a")], "free of forces in 2 s"
    scale = 1.01e-9 * length / 4.0
    assert len(equilibrium.equilibria(DOOR, 4)) == 2
    far = DOOR.with_("body[bar].position", (4.0, 0.0, 0.0))
    scale = equilibrium.FORCE_FREE * 4.0 / 2.0**2
    assert equilibrium.equilibria(far, 4) == [("at", "a")], "a mechanism of 4 m, at the limit itself"
    scale = math.nextafter(scale, 1.0)
    assert len(equilibrium.equilibria(far, 4)) == 2
    reason = "the loads change"
    driven = DOOR.with_(gravity=(0.0, 0.0, -10.0), driver=(Driver(joint="A", polynomial=(0.0, 3.0)),))
    monkeypatch.setattr(equilibrium, "_frame", lambda scene: Turning(np.zeros(3), np.zeros(3), "A"))
    with pytest.raises(SceneError, match=r"driver\[A\]: the loads change, so the motion is not steady"):
        equilibrium.equilibria(driven)


def test_scenes_without_an_equilibrium():
    bare = BAR.model_copy(update={"mass": None, "inertia": None})
    varying = Moment(body="bar", moment=Z, factor=Factor(polynomial=(0.0, 1.0)))
    constant = Moment(body="bar", moment=Z, factor=Factor(polynomial=(2.0,)))
    locked = DOOR.with_(driver=(Driver(joint="A"),))
    for scene, says in (
        (DOOR.with_(body=(bare,)), r"body\[bar\]\.mass: is missing; an equilibrium needs the mass"),
        (DOOR.with_(load=(constant, varying)), r"load\[1\]\.factor: varies; an equilibrium needs loads"),
        (locked, "the mechanism has no degree of freedom, so it rests at any load"),
    ):
        with pytest.raises(SceneError, match=says):
            equilibrium._frame(scene)
    assert equilibrium._frame(DOOR.with_(load=(constant,))).rate == 0.0


def test_the_equilibrium_of_a_hanging_door():
    """s² + 0.2 s + 20 / 2.3 = 0; the shape is 1 m along x, for 1 rad about z; the hinge bears 20 N."""
    found = equilibrium._equilibrium(tangent(Model(hanging())))
    root = complex(-0.1, math.sqrt(20 / 2.3 - 0.01))
    assert found.eigenvalues == pytest.approx(np.array([root, root.conjugate()]), rel=1e-8)
    assert found.shapes.shape == (2, 1, 6) and found.shapes[0, 0, [0, 5]] == pytest.approx([1.0, 1.0])
    assert np.abs(found.shapes[0, 0, 1:5]).max() < 1e-12
    assert (
        found.reactions["A"] == pytest.approx([0.0, 20.0, 0.0, 0.0, 0.0, 0.0], abs=1e-9) and found.rate == 0.0
    )
    assert found.frequencies == pytest.approx([abs(root) / (2 * math.pi)]) and found.stability == "stable"
    assert found.damping_ratios == pytest.approx([0.1 / abs(root)]) and found.oscillating.tolist() == [0]
    assert repr(found) == f"<Equilibrium of 'door': stable; {found.frequencies[0]:.6g} Hz>"


@pytest.mark.parametrize(
    ("values", "stability"),
    [
        ([], "indifferent"),
        ([0.0, 0.0], "indifferent"),
        ([1e-6, -1.0], "stable"),
        ([0.9e-6, -1.0], "indifferent"),
        ([1.1e-6, -1.0], "unstable"),
        ([1j, -1j], "stable"),
        ([complex(1e-6, 1.0), complex(1e-6, -1.0)], "stable"),
        ([complex(2e-6, 1.0), complex(2e-6, -1.0)], "unstable"),
    ],
)
def test_stability_by_eigenvalues(values, stability):
    made = equilibrium.Equilibrium(DOOR, np.array(values, complex), np.zeros((len(values), 1, 6)), {})
    assert made.stability == stability
    listed = f"; {made.frequencies[0]:.6g} Hz" if made.frequencies.size else ""
    assert repr(made) == f"<Equilibrium of 'door': {stability}{listed}>"
    turning = equilibrium.Equilibrium(DOOR, np.zeros(0, complex), np.zeros((0, 1, 6)), {}, rate=2.0)
    assert repr(turning) == "<Steady motion of 'door': indifferent>"


# --- offsets ------------------------------------------------------------------------------------------------
PAIR = Scene(
    name="pair",
    body=(BAR, BAR.model_copy(update={"name": "rod"})),
    joint=(HINGE, Revolute(name="B", bodies=("ground", "rod"), anchor=(0.0, 0.0, 0.0), axis=Z)),
    coupling=(Coupling(name="G", joints=("A", "B"), ratio=2.0, offset=1.0),),
)


def test_offsets_are_reached_in_small_parts(monkeypatch):
    """q₂ = 1 + 2 q₁: equal bodies move by about q₁ = -0.4 and q₂ = 0.2, in parts of equal size."""
    parts: list[float] = []
    solve = offsets.solve_positions

    def solved(model: Any, t: float, q: np.ndarray, value: np.ndarray) -> Any:
        parts.append(float(np.abs(value).max()))
        return solve(model, t, q, value)

    monkeypatch.setattr(offsets, "solve_positions", solved)
    found = offsets.assembled.__wrapped__(PAIR)
    turned = [2 * math.atan2(body.orientation[3], body.orientation[0]) for body in found.body]
    assert turned == pytest.approx([-0.4, 0.2], abs=2e-3) and found.coupling[0].offset == 0.0
    assert turned[1] - 2 * turned[0] == pytest.approx(1.0, abs=1e-12)
    tried, used = parts[: parts.index(parts[-1])], parts[parts.index(parts[-1]) :]
    assert tried == pytest.approx([0.5 / 2**k for k in range(len(tried))])
    assert len(used) == 1 + round(0.5 / used[-1]), "one trial of the last size, and its parts"


@pytest.mark.parametrize(
    ("shift", "turn", "small"),
    [(0.4, 0.0, True), (0.41, 0.0, False), (0.0, 0.1, True), (0.0, 0.101, False), (-0.41, 0.0, False)],
)
def test_parts_of_an_offset_are_small(monkeypatch, shift, turn, small):
    """0.2 of a mechanism of 2 m, or 0.2 rad: half of it in a quaternion."""
    q = np.zeros(14)
    model = SimpleNamespace(length=2.0, start=lambda: q)
    monkeypatch.setattr(offsets, "Model", lambda scene: model)
    end = q.copy()
    end[8], end[12] = shift, turn
    monkeypatch.setattr(offsets, "solve_positions", lambda *given: (end, None))
    assert offsets._is_small(PAIR, np.zeros(1)) is small


def test_an_offset_that_no_pose_obeys():
    model: Any = SimpleNamespace(row_joint=["A", "G", "B"])
    couplings = [("G", 1.0), ("H", 0.0), ("K", -0.5)]
    scene: Any = SimpleNamespace(coupling=[SimpleNamespace(name=n, offset=x) for n, x in couplings])
    text = offsets._unmet(scene, model, np.array([0.0, -0.25, 0.1]), 0.375)
    assert text == (
        "coupling: no pose obeys the offsets of G (1), K (-0.5); after 38 % of them 0.25 m or rad "
        "remain open at 'G'"
    )


# --- places and exchanges -----------------------------------------------------------------------------------
def test_places_of_points_and_directions():
    turned = rotations.from_vector(np.array([0.0, 0.0, math.pi / 2]))
    model = Model(DOOR)
    q = np.array([0.0, 1.0, 0.5, *turned])
    assert placed.place(model, "bar", (2.0, 0.0, 0.0), q) == pytest.approx((0.0, 2.0, 0.5))
    assert placed.place(model, "ground", (2.0, 1.0, 0.0), q) == (2.0, 1.0, 0.0)
    assert (
        placed._direction(model, "bar", X, q) == (0.0, 1.0, 0.0)
        and placed._direction(model, "ground", X, q) == X
    )
    assert placed._three(np.array([-1e-16, 4e-16, 1.0])) == (0.0, 0.0, 1.0)
    assert math.copysign(1.0, placed._three(np.array([-1e-16]))[0]) == 1.0


@pytest.mark.parametrize(
    ("kind", "axis"), [("universal", X), ("universal", (0.0, 3.0, 0.0)), ("spherical", Z), ("cylindrical", Y)]
)
def test_joints_as_other_types(kind, axis):
    """The anchor is that of the second body; a universal joint gets a second axis across the first."""
    made = exchange._as(Revolute(name="J", bodies=("a", "b"), anchor=(1.0, 2.0, 3.0), axis=axis), kind)
    assert (made.type, made.name, made.bodies) == (kind, "J", ("a", "b")) and made.anchor_pair[1] == (
        1.0,
        2.0,
        3.0,
    )
    if kind == "universal":
        assert made.axes[0] == axis and np.dot(*made.axes) == 0.0 and np.linalg.norm(made.axes[1]) > 0.5
    if kind == "cylindrical":
        assert made.axis == axis
    rod = Distance(name="D", bodies=("a", "b"), anchors=((0.0, 0.0, 0.0), (4.0, 0.0, 0.0)))
    assert exchange._as(rod, "inline").axis == Z and exchange._as(rod, "inline").anchor == (4.0, 0.0, 0.0)


def test_the_rows_that_a_weaker_joint_lacks():
    """Of rows e₁, e₂, e₃ the weaker joint keeps e₁ and e₃: it lacks the second row of the dependences."""
    own, dependences = np.eye(3, 6), np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])
    found = exchange._weaker(own[[0, 2]], own, dependences)
    assert found.rows.tolist() == own[[0, 2]].tolist() and found.lost.shape == (1, 2)
    assert np.abs(found.lost) == pytest.approx(np.array([[0.3, 0.4]]))
    removed = exchange._weaker(own[:0], own, dependences)
    assert removed.lost.shape == (3, 2) and removed.lost.T @ removed.lost == pytest.approx(
        dependences.T @ dependences
    )


def test_rows_by_joint():
    rows = exchange._rows(Model(RODS))
    assert {name: len(found) for name, found in rows.items()} == {"A": 5, "B": 5, "D": 1}
    assert np.linalg.norm(rows["D"], axis=1) == pytest.approx([1.0])


def test_the_direction_of_a_slide_is_carried_by_its_first_body():
    slide = Translational(name="S", bodies=("bar", "ground"), anchor=(2.0, 0.0, 0.0), axis=X)
    model = Model(DOOR.with_(joint=(slide,)))
    q = np.array([0.0, 1.0, 0.0, *rotations.from_vector(np.array([0.0, 0.0, math.pi / 2]))])
    found = placed._carried(model, slide, q)
    assert found == {"anchor": (2.0, 0.0, 0.0), "axis": (0.0, 1.0, 0.0)}
