"""Rows, their derivatives and functions of time, with interpreted kernels / motions that are differentiated.

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

from mbref.equations import coordinates, evaluation, functions, loads, primitives
from mbref.kernels.scene_layout import COUPLED_ANGLE, COUPLED_SLIDE, DISTANCE, DOT1, DOT2, POINT

GROUND = 2  # bodies 0 and 1 move
H = 1e-3  # s; differences of order 4 of a motion with frequencies of about 1/s


# --- a motion without accelerations -----------------------------------------------------------------------
PLACES = np.array([[0.3, -0.2, 0.5], [1.1, 0.4, -0.6], [0.0, 0.0, 0.0]])
SPEEDS = np.array([[0.7, -0.4, 0.2], [-0.3, 0.8, 0.6], [0.0, 0.0, 0.0]])
SPINS = np.array([[0.5, -0.9, 0.4], [-0.6, 0.3, 1.1], [0.0, 0.0, 0.0]])  # rad/s, body axes
TURNED = np.array([[0.4, 0.2, -0.7], [-0.3, 0.9, 0.5], [0.0, 0.0, 0.0]])  # rotation vectors at t = 0
VECTORS = {
    "point_first": np.array([0.2, -0.5, 0.3]),
    "point_second": np.array([-0.4, 0.1, 0.6]),
    "direction_first": np.array([0.8, 0.6, 0.0]),
    "turning_first": np.array([-0.6, 0.8, 0.0]),
    "direction_second": np.array([0.36, 0.48, 0.8]),
}


def matrix(b: int, t: float) -> np.ndarray:
    """The rotation matrix of a body whose angular velocity in its own axes is constant."""
    at_start, turn = (rotations.to_matrix(rotations.from_vector(w)) for w in (TURNED[b], t * SPINS[b]))
    return np.asarray(at_start @ turn)


def place(b: int, t: float) -> np.ndarray:
    return np.asarray(PLACES[b] + t * SPEEDS[b])


def angle(t: float) -> tuple[float, float, float]:
    """Value, rate and acceleration that a driver prescribes."""
    return 0.3 + 0.7 * t + 0.2 * t * t, 0.7 + 0.4 * t, 0.4


def value(kind: str, i: int, j: int, t: float, length: float) -> np.ndarray:
    """Φ of the motion at a time, from its definition."""
    first, second = matrix(i, t), matrix(j, t)
    p_i = place(i, t) + first @ VECTORS["point_first"]
    p_j = place(j, t) + second @ VECTORS["point_second"]
    x, y, u = (VECTORS[name] for name in ("direction_first", "turning_first", "direction_second"))
    along, d = first @ x, p_j - p_i
    if kind == "point":
        return np.asarray(p_i - p_j)
    if kind == "distance":
        return np.array([(d @ d - length**2) / (2 * length)])
    if kind.startswith("dot1"):
        turned = x if kind == "dot1" else y * math.cos(angle(t)[0]) - x * math.sin(angle(t)[0])
        return np.array([(first @ turned) @ (second @ u)])
    if kind == "angle":
        return np.array([length * math.atan2((second @ u) @ (first @ y), (second @ u) @ along)])
    free = along @ d - (angle(t)[0] if kind == "dot2 driven" else 0.0)
    return np.array([free * (length if kind == "slide" else 1.0)])


def derivatives(kind: str, i: int, j: int, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Φ, Φ' and Φ'' at t = 0, by differences."""
    at = [value(kind, i, j, k * H, length) for k in (-2, -1, 0, 1, 2)]
    first = (at[0] - 8 * at[1] + 8 * at[3] - at[4]) / (12 * H)
    second = (-at[0] + 16 * at[1] - 30 * at[2] + 16 * at[3] - at[4]) / (12 * H * H)
    return at[2], first, second


KINDS = {
    "point": (POINT, -1),
    "dot1": (DOT1, -1),
    "dot1 driven": (DOT1, 3),
    "dot2": (DOT2, -1),
    "dot2 driven": (DOT2, 3),
    "distance": (DISTANCE, -1),
    "angle": (COUPLED_ANGLE, -1),
    "slide": (COUPLED_SLIDE, -1),
}
ROW, ROWS = 2, 6


def equations(kind: str, i: int, j: int, length: float) -> Any:
    """Memory at t = 0 whose second primitive has the wanted kind, in row 2 of 6; the first is of no use."""
    number, driver = KINDS[kind]
    of = SimpleNamespace(
        kind=np.array([9, number]),
        first=np.array([9, i]),
        second=np.array([9, j]),
        driver=np.array([9, driver]),
        row=np.array([9, ROW]),
        begins=np.array([9, 1]),
        column_first=np.array([99, 6]),
        column_second=np.array([99, 0]),
        angle=np.array([9, 1]),
        length=np.array([99.0, length]),
        **{name: np.array([[9.0, 9.0, 9.0], vector]) for name, vector in VECTORS.items()},
    )
    frames = SimpleNamespace(
        position=PLACES.copy(),
        rotation=np.array([matrix(b, 0.0).ravel() for b in range(3)]),
        velocity=SPEEDS.copy(),
        angular_velocity=SPINS.copy(),
    )
    rows = SimpleNamespace(**{name: np.full(ROWS, 7.0) for name in ("phi", "nu", "gamma", "phi_rate")})
    blocks = np.zeros((ROWS, 12)) if kind == "point" else np.full((ROWS, 12), 7.0)
    return SimpleNamespace(
        scene=SimpleNamespace(primitives=of),
        frames=frames,
        rows=rows,
        angles=np.array([9.0, 0.0]),
        system=SimpleNamespace(blocks=blocks),
    )


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> None:
    def prescribed(driver: int, t: float, equations: Any) -> tuple[float, float, float]:
        assert driver == 3
        return angle(t)

    monkeypatch.setattr(primitives, "function_value", prescribed)


CASES = [(kind, *pair) for kind in KINDS for pair in ((0, 1), (1, 0), (GROUND, 1), (0, GROUND))]


@pytest.mark.usefixtures("driven")
@pytest.mark.parametrize(("kind", "i", "j"), CASES)
def test_rows_and_their_derivatives(kind, i, j):
    """Without accelerations Φ' = Φ_q v - ν and Φ'' = -γ; the rows of other primitives are unchanged."""
    length = -1.7 if kind in ("angle", "slide") else 1.7
    made, count = equations(kind, i, j, length), 3 if kind == "point" else 1
    before = made.system.blocks.copy()
    if kind == "point":
        made.rows.nu[:] = 0.0
    primitives.constraints(0.0, SimpleNamespace(**{**vars(made), "scene": only_second(made)}))
    found, rate, second = derivatives(kind, i, j, length)
    own = slice(ROW, ROW + count)
    assert made.rows.phi[own] == pytest.approx(found, abs=1e-14)
    assert made.rows.gamma[own] == pytest.approx(-second, abs=2e-8)
    columns = (6, 0) if kind in ("angle", "slide") else (0, 6)
    along = np.zeros(count)
    for body, column in zip((i, j), columns, strict=True):
        if body != GROUND:
            along += made.system.blocks[own, column : column + 3] @ SPEEDS[body]
            along += made.system.blocks[own, column + 3 : column + 6] @ SPINS[body]
    assert along - made.rows.nu[own] == pytest.approx(rate, abs=1e-9)
    others = [row for row in range(ROWS) if not ROW <= row < ROW + count]
    assert (made.rows.phi[others] == 7.0).all() and (made.rows.gamma[others] == 7.0).all()
    assert made.system.blocks[others].tolist() == before[others].tolist()
    if kind in ("dot1", "dot2", "distance", "angle", "slide"):
        assert made.rows.nu[ROW] == 0.0


def only_second(made: Any) -> Any:
    """The scene without its first primitive."""
    of = made.scene.primitives
    return SimpleNamespace(
        primitives=SimpleNamespace(**{name: array[1:] for name, array in vars(of).items()})
    )


@pytest.mark.usefixtures("driven")
@pytest.mark.parametrize("kind", KINDS)
def test_each_primitive_reads_its_own_numbers(kind):
    """The second of two primitives, of which the first has no body."""
    made, alone = equations(kind, 0, 1, 1.7), equations(kind, 0, 1, 1.7)
    primitives.constraints(0.0, SimpleNamespace(**{**vars(alone), "scene": only_second(alone)}))
    given = {"dot1": (1, 0.0), "dot2": (1, 0.0)}.get(kind.split()[0], (1,))
    names = {"angle": "joint_coordinate", "slide": "joint_coordinate"}
    getattr(primitives, names.get(kind, kind.split()[0]))(*given, made)
    assert made.rows.phi.tolist() == alone.rows.phi.tolist()
    assert made.system.blocks.tolist() == alone.system.blocks.tolist()


def test_two_coordinates_share_the_row_of_a_coupling():
    """An angle between bodies 0 and 1, and a displacement of body 1 on the ground; factors 0.5 and -2."""
    one, two = equations("angle", 0, 1, 0.5), equations("slide", 1, GROUND, -2.0)
    for made in (one, two):
        primitives.joint_coordinate(1, made)
    first, second = one.system.blocks[ROW].copy(), two.system.blocks[ROW]
    two.scene.primitives.begins[1], two.system, two.rows = 0, one.system, one.rows
    two.scene.primitives.column_first[1], two.scene.primitives.column_second[1] = 0, 6
    expected = first.copy()
    expected[:6] += second[6:]
    expected[6:] += second[:6]
    phi = one.rows.phi[ROW] + value("slide", 1, GROUND, 0.0, -2.0)[0]
    primitives.joint_coordinate(1, two)
    assert one.system.blocks[ROW] == pytest.approx(expected) and one.rows.phi[ROW] == pytest.approx(phi)
    assert one.rows.nu[ROW] == 0.0
    gamma = -derivatives("angle", 0, 1, 0.5)[2] - derivatives("slide", 1, GROUND, -2.0)[2]
    assert one.rows.gamma[ROW] == pytest.approx(gamma[0], abs=2e-8)


def test_constant_entries_of_a_point_are_written_once():
    made = equations("point", 0, 1, 0.0)
    primitives.point(1, made)
    one = np.hstack([np.eye(3), -np.eye(3)])
    assert made.system.blocks[ROW : ROW + 3][:, [0, 1, 2, 6, 7, 8]].tolist() == one.tolist()
    made.system.blocks[ROW : ROW + 3, [1, 6]] = 5.0
    primitives.point(1, made)
    assert (made.system.blocks[ROW : ROW + 3, [1, 6]] == 5.0).all()


def test_entries_of_the_fixed_frame_are_left_out():
    made = equations("point", GROUND, 1, 0.0)
    primitives.point(1, made)
    assert not made.system.blocks[:, 3:6].any() and made.system.blocks[ROW : ROW + 3, 9:].any()


@pytest.mark.parametrize(
    ("reference", "turns"),
    [(0.0, 0), (3.0, 0), (3.2, 1), (-3.9, -1), (-3.2, -1), (9.0, 1), (9.6, 2), (-9.9, -2)],
)
def test_an_angle_is_the_one_nearest_to_the_last(reference, turns):
    """The angle of the sine 0.3 and the cosine 2, and whole turns."""
    found = primitives.unwrapped_angle(0.3, 2.0, reference + math.atan2(0.3, 2.0))
    assert found == pytest.approx(math.atan2(0.3, 2.0) + 2 * math.pi * turns)


# --- evaluation -------------------------------------------------------------------------------------------
def test_poses_and_velocities_of_bodies():
    """A quaternion of any length gives the rotation matrix of its direction."""
    q = np.concatenate(
        [[1.0, 2.0, 3.0], 1.7 * rotations.from_vector(TURNED[0]), [4.0, 5.0, 6.0, 0.6, 0.0, 0.0, -0.8]]
    )
    frames = SimpleNamespace(
        position=np.full((3, 3), 9.0),
        rotation=np.full((3, 9), 9.0),
        velocity=np.full((3, 3), 9.0),
        angular_velocity=np.full((3, 3), 9.0),
    )
    evaluation.set_poses(q, frames)
    evaluation.set_velocities(np.arange(12.0), frames)
    assert frames.position.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [9.0] * 3]
    assert frames.rotation[0] == pytest.approx(matrix(0, 0.0).ravel())
    assert frames.rotation[1] == pytest.approx([-0.28, 0.96, 0, -0.96, -0.28, 0, 0, 0, 1])
    assert frames.velocity.tolist() == [[0.0, 1.0, 2.0], [6.0, 7.0, 8.0], [9.0] * 3]
    assert frames.angular_velocity.tolist() == [[3.0, 4.0, 5.0], [9.0, 10.0, 11.0], [9.0] * 3]


def of_rows() -> Any:
    """Rows of bodies (1, ground) and (0, 1), with blocks 1 to 12 and 13 to 24."""
    return SimpleNamespace(
        scene=SimpleNamespace(row_bodies=np.array([[1, 2], [0, 1]])),
        system=SimpleNamespace(
            blocks=np.arange(1.0, 25.0).reshape(2, 12),
            rhs=np.full(2, 9.0),
            jacobian=np.full((2, 12), 9.0),
            settings=SimpleNamespace(velocity_gain=0.0, position_gain=0.0),
            counts=SimpleNamespace(evaluations=4),
        ),
        rows=SimpleNamespace(
            nu=np.array([0.5, 0.25]),
            phi_rate=np.full(2, 9.0),
            phi=np.array([3.0, -2.0]),
            gamma=np.array([10.0, 20.0]),
        ),
        frames="frames",
    )


JACOBIAN = np.array([[0.0] * 6 + [1.0, 2, 3, 4, 5, 6], np.arange(13.0, 25.0)])


def test_the_jacobian_and_rates_of_violation():
    made, dense, v = of_rows(), np.full((2, 12), 9.0), np.cos(np.arange(12.0))
    evaluation.assemble_jacobian(made, dense)
    assert dense.tolist() == JACOBIAN.tolist()
    evaluation.violation_rate(v, made)
    assert made.rows.phi_rate == pytest.approx(JACOBIAN @ v - [0.5, 0.25])
    none = np.zeros((0, 12))
    evaluation.assemble_jacobian(made, none)
    for count in (1, 3):  # more or fewer rows than bodies of a row
        made.scene.row_bodies = np.array([[1, 2], [0, 1], [0, 2]])[:count]
        made.system.blocks = np.arange(1.0, 37.0).reshape(3, 12)[:count]
        made.rows.nu, made.rows.phi_rate = np.array([0.5, 0.25, 2.0])[:count], np.full(count, 9.0)
        whole = np.vstack([JACOBIAN, [*range(25, 31), *[0.0] * 6]])[:count]
        dense = np.full((count, 12), 9.0)
        evaluation.assemble_jacobian(made, dense)
        evaluation.violation_rate(v, made)
        assert dense.tolist() == whole.tolist()
        assert made.rows.phi_rate == pytest.approx(whole @ v - made.rows.nu)


@pytest.mark.parametrize(("velocity", "position"), [(0.0, 0.0), (2.0, 0.0), (0.0, 3.0), (2.0, 3.0)])
def test_the_right_hand_side_with_feedback(velocity, position):
    made, v = of_rows(), np.sin(np.arange(12.0))
    made.system.settings.velocity_gain, made.system.settings.position_gain = velocity, position
    evaluation.right_hand_side(v, made)
    rate = JACOBIAN @ v - [0.5, 0.25]
    assert made.system.rhs == pytest.approx([10.0, 20.0] - velocity * rate - position * made.rows.phi)
    if not (velocity or position):
        assert made.rows.phi_rate.tolist() == [9.0, 9.0], "nothing needs them"


def test_parts_of_an_evaluation_in_their_order(monkeypatch):
    calls: list[Any] = []
    names = ("set_poses", "set_velocities", "constraints", "forces", "assemble_jacobian", "right_hand_side")
    for name in names:
        monkeypatch.setattr(evaluation, name, lambda *given, name=name: calls.append((name, *given)))
    made = of_rows()
    evaluation.assemble_system(0.5, "q", "v", made)
    assert made.system.counts.evaluations == 5
    assert calls == [
        ("set_poses", "q", "frames"),
        ("set_velocities", "v", "frames"),
        ("constraints", 0.5, made),
        ("forces", 0.5, made),
        ("assemble_jacobian", made, made.system.jacobian),
        ("right_hand_side", "v", made),
    ]


def test_terms_at_several_states(monkeypatch):
    made, selected = of_rows(), []
    made.system.force = np.zeros(2)

    def evaluate(t: float, q: Any, v: Any, equations: Any) -> None:
        made.system.blocks[:] = t
        made.rows.phi[:], made.rows.nu[:], made.rows.gamma[:] = q[0], v[0], (q[0] + v[0], t)
        made.system.force[:] = (t, 2 * t)

    monkeypatch.setattr(evaluation, "evaluate", evaluate)
    monkeypatch.setattr(evaluation, "select_pieces", lambda t, equations: selected.append((t, equations)))
    blocks, rows, forces = np.zeros((2, 24)), np.zeros((2, 6)), np.zeros((2, 2))
    q, v = np.array([[3.0], [4.0]]), np.array([[5.0], [6.0]])
    assert evaluation.evaluate_along.function(np.array([0.5, 0.75]), q, v, blocks, rows, forces, made) == 2
    assert selected == [(0.5, made), (0.75, made)] and blocks.tolist() == [[0.5] * 24, [0.75] * 24]
    assert rows.tolist() == [[3.0, 3, 5, 5, 8, 0.5], [4.0, 4, 6, 6, 10, 0.75]]
    assert forces.tolist() == [[0.5, 1.0], [0.75, 1.5]]


# --- coordinates ------------------------------------------------------------------------------------------
def test_rates_of_coordinates_and_displacements():
    """p' = ½ p (0, ω'), and p + ½ p (0, δπ') of unit length."""
    p = np.array([rotations.from_vector(TURNED[0]), rotations.from_vector(TURNED[1])])
    q = np.column_stack([PLACES[:2], p]).ravel()
    v = np.column_stack([SPEEDS[:2], SPINS[:2]]).ravel()
    rates = np.full(14, 9.0)
    coordinates.coordinate_rates(q, v, rates)
    of_p = 0.5 * rotations.multiply(p, np.column_stack([np.zeros(2), SPINS[:2]]))
    assert rates == pytest.approx(np.column_stack([SPEEDS[:2], of_p]).ravel())
    both, change = np.stack([q, q]), np.full(14, 9.0)
    assert coordinates.displace_all.function(both, np.stack([v, 0.5 * v]), change) == 2
    for row, part in zip(both.reshape(2, 2, 7), (1.0, 0.5), strict=True):
        moved = p + part * of_p
        moved /= np.linalg.norm(moved, axis=1, keepdims=True)
        assert row == pytest.approx(np.column_stack([PLACES[:2] + part * SPEEDS[:2], moved]))


# --- functions of time ------------------------------------------------------------------------------------
def of_time() -> Any:
    """Two functions: the second has the pieces 1, 2 and 3, from 0, 1 and 3 s; piece 2 is chosen."""
    return SimpleNamespace(
        scene=SimpleNamespace(
            functions=SimpleNamespace(
                first=np.array([0, 1, 4]),
                amplitude=np.array([9.0, 0.5]),
                frequency=np.array([9.0, 4.0]),
                phase=np.array([9.0, 0.3]),
                polynomial=np.array([[9.0] * 4, [1.0, -2.0, 0.5, 3.0]]),
                begin=np.array([0.0, 0.0, 1.0, 3.0]),
                part=np.array([9.0, 0.0, 1.0, 9.0]),
                cubic=np.array([[9.0] * 4, [5.0, 6.0, 7.0, 8.0], [0.1, -0.2, 0.3, 0.4], [9.0] * 4]),
            )
        ),
        piece=np.array([0, 2]),
    )


def of_second(t: float, order: int) -> float:
    """A derivative of 1 - 2 t + t²/2 + 3 t³ + sin(4 t + 0.3)/2 and the cubic of t - 1."""
    polynomial = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0])
    cubic = np.polynomial.Polynomial([0.1, -0.2, 0.3, 0.4])
    wave = 0.5 * 4.0**order * math.sin(4.0 * t + 0.3 + order * math.pi / 2)
    steady = polynomial.deriv(order)(t) if order else polynomial(t)
    return float(steady + wave + (cubic.deriv(order)(t - 1) if order else cubic(t - 1)))


@pytest.mark.parametrize("t", [1.0, 1.7, 2.5])
def test_value_rate_and_acceleration_of_a_function(t):
    found = functions.function_value(1, t, of_time())
    assert found == pytest.approx([of_second(t, order) for order in range(3)])
    series = np.full(7, 9.0)
    functions.expand_function(t, 1, of_time(), series)
    assert series == pytest.approx([of_second(t, k) / math.factorial(k) for k in range(7)])


def without_wave(part: float, amplitude: float) -> Any:
    made = of_time()
    made.scene.functions.part[2], made.scene.functions.amplitude[1] = part, amplitude
    return made


@pytest.mark.parametrize(("part", "amplitude"), [(0.0, 0.5), (1.0, 0.0), (1.0, 0.5)])
@pytest.mark.parametrize("size", [4, 6])
def test_series_of_functions(part, amplitude, size):
    """A series about 1.5 s whose sum half a second later is the function's value."""
    made, series = without_wave(part, amplitude), np.full(size, 9.0)
    functions.expand_function(1.5, 1, made, series)
    rates = functions.function_value(1, 1.5, made)
    assert series[:3] == pytest.approx([rates[0], rates[1], rates[2] / 2])
    third = 0.4 + part * (3.0 - amplitude * 64 * math.cos(6.3) / 6)
    assert series[3] == pytest.approx(third)
    wave = part * amplitude
    later = [wave * 256 * math.sin(6.3) / 24, wave * 1024 * math.cos(6.3) / 120]
    assert series[4:] == pytest.approx(later[: size - 4], abs=1e-12)


@pytest.mark.parametrize(("k", "value"), [(0, 1 - 4 + 2 + 24), (1, -2 + 2 + 36), (2, 0.5 + 18), (3, 3.0)])
def test_coefficients_of_a_polynomial_about_two(k, value):
    """1 - 2 t + t²/2 + 3 t³ about t = 2."""
    assert functions.shifted(np.array([1.0, -2.0, 0.5, 3.0]), k, 2.0) == pytest.approx(value)


@pytest.mark.parametrize(
    ("t", "piece", "end"), [(-1.0, 1, 1.0), (0.5, 1, 1.0), (1.0, 2, 3.0), (2.9, 2, 3.0), (3.0, 3, math.inf)]
)
def test_pieces_and_their_ends(t, piece, end):
    made = of_time()
    functions.select_pieces(t, made)
    assert made.piece.tolist() == [0, piece] and functions.end_of_pieces(made) == end
    made.scene.functions.first, made.piece = np.array([0, 4, 4]), np.array([1])
    assert functions.end_of_pieces(made) == 1.0


# --- angles and points of loads ---------------------------------------------------------------------------
def test_the_motion_of_a_point():
    frames = equations("point", 0, 1, 0.0).frames
    s, turned = VECTORS["point_first"], matrix(1, 0.0)
    position, velocity = loads.point_motion(1, tuple(s), frames)
    assert position == pytest.approx(PLACES[1] + turned @ s)
    assert velocity == pytest.approx(SPEEDS[1] + turned @ np.cross(SPINS[1], s))


def test_angles_of_loads_and_couplings_are_remembered():
    """Slot 0 belongs to the second load and slot 1 to the second primitive; each is near its last value."""
    made, last = equations("angle", 0, 1, 0.5), 4 * math.pi
    x, y, u = (VECTORS[name] for name in ("direction_first", "turning_first", "direction_second"))
    table = lambda vector: np.array([[9.0, 9.0, 9.0], vector])  # noqa: E731
    made.scene.loads = SimpleNamespace(
        angle=np.array([-1, 0]),
        first=np.array([9, 1]),
        second=np.array([9, GROUND]),
        x_first=table(x),
        y_first=table(y),
        x_second=table(u),
    )
    made.scene.primitives.angle[:] = -1, 1
    made.angles[:] = last, -last
    loads.remember_angles(made)
    of_load = math.atan2(u @ matrix(1, 0.0) @ y, u @ matrix(1, 0.0) @ x)
    of_coupling = value("angle", 0, 1, 0.0, 1.0)[0]
    wanted = [of_load + last, of_coupling - last]
    assert made.angles == pytest.approx(wanted)


# --- loads on the last of many bodies ---------------------------------------------------------------------
def frames_of(count: int) -> Any:
    """Frames of bodies and the fixed frame, parallel to the world's axes."""
    return SimpleNamespace(
        rotation=np.tile(np.eye(3).ravel(), (count + 1, 1)), angular_velocity=np.zeros((count + 1, 3))
    )


def test_a_force_on_the_ninth_body():
    frames, g = frames_of(9), np.zeros(54)
    loads.push(8, (0.0, 0.0, 1.0), (1.0, 2.0, 3.0), frames, g)
    assert g[48:].tolist() == [1.0, 2.0, 3.0, -2.0, 1.0, 0.0] and not g[:48].any()
    loads.push(9, (0.0, 0.0, 1.0), (1.0, 2.0, 3.0), frames, g)
    assert not g[:48].any() and g[50] == 3.0, "the fixed frame"


@pytest.mark.parametrize(("first", "second"), [(7, 8), (9, 8), (8, 9), (0, 1)])
def test_a_spring_about_the_axis_of_two_of_nine_bodies(monkeypatch, first, second):
    """Torque 10, stiffness 2 at 0.5 - 0.25 rad, damping 4 at 1.5 - 1 rad/s: 7.5 N m about z."""
    frames, g = frames_of(9), np.zeros(54)
    frames.angular_velocity[first, 2], frames.angular_velocity[second, 2] = 1.0, 1.5
    made = SimpleNamespace(
        first=[9, first], second=[9, second], axis=np.array([[9.0, 9.0, 9.0], [0.0, 0.0, 1.0]]),
        stiffness=[9.0, 2.0], natural=[9.0, 0.25], damping=[9.0, 4.0],
    )  # fmt: skip
    monkeypatch.setattr(
        loads, "angle_of_load", lambda *given: 0.5 if given == (1, "angles", made, frames.rotation) else None
    )
    loads.act_about_axis(1, 10.0, made, frames, "angles", g)
    expected = np.zeros(60)
    expected[6 * second + 5], expected[6 * first + 5] = 7.5, -7.5
    assert g.tolist() == expected[:54].tolist()
