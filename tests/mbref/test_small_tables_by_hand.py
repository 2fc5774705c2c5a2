"""Figures of columns, fields of joints and loads, formats, and starts of batches by hand."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from mbref import formats, rotations, scene_fields, scene_joints, scene_loads
from mbref.design.equilibrium import Equilibrium
from mbref.drawing import plot
from mbref.drawing.picture import Form, Look
from mbref.drawing.svg import COLOURS, GREY
from mbref.drawing.timeline import Timeline
from mbref.ensembles import candidates
from mbref.ensembles.simulate_all import Ended
from mbref.equations.initial_state import Start
from mbref.input_error import InputError
from mbref.motion import Motion
from mbref.scene import Body, Driver, Factor, Scene, SceneError, Sine
from mbref.simulation import rounded_numbers, simulate
from mbref.trajectory import Cost, Trajectory
from mbref.variation import Variation

X = (1.0, 0.0, 0.0)
TIMES = np.array([0.0, 0.5, 2.0])


def column(*values: float) -> np.ndarray:
    return np.array(values)


# --- figures ------------------------------------------------------------------------------------------------
def test_the_panels_of_a_figure():
    """Two panels: both angles, and a violation on a logarithmic scale."""
    columns = {
        "time": TIMES,
        "A.angle": column(0.0, 1.0, 2.0),
        "B.angle": column(0.0, -1.0, 3.0),
        "position_violation": column(1e-15, 1e-13, 1e-12),
    }
    figure = plot.plot(columns, ["A.angle", "B.angle", "position_violation"])
    assert figure.get_size_inches().tolist() == pytest.approx([7.2, 1.2 + 2 * 1.9])
    assert type(figure.get_layout_engine()).__name__ == "ConstrainedLayoutEngine"
    angles, violation = figure.axes
    lines = [(line.get_label(), line.get_color()) for line in angles.lines]
    assert lines == [("A.angle", COLOURS[0]), ("B.angle", COLOURS[1])]
    assert angles.lines[1].get_xdata().tolist() == TIMES.tolist()
    assert angles.lines[1].get_ydata().tolist() == [0.0, -1.0, 3.0]
    assert angles.get_ylabel() == "angle, rad" and violation.get_ylabel() == "position violation, m or rad"
    assert (angles.get_yscale(), violation.get_yscale()) == ("linear", "log")
    assert (angles.get_xlabel(), violation.get_xlabel()) == ("", "time, s")
    assert angles.get_shared_x_axes().joined(angles, violation)
    for axes in (angles, violation):
        assert [axes.spines[side].get_visible() for side in ("top", "right", "left")] == [False, False, True]
        grid = axes.xaxis.get_gridlines()[0]
        assert grid.get_visible() and grid.get_alpha() == 0.25 and grid.get_color() == GREY
        key = axes.get_legend()
        assert not key.get_frame_on() and key._loc == 6, "centre of the left side"
        place = axes.transAxes.inverted().transform(key.get_bbox_to_anchor().get_points())
        assert place[0] == pytest.approx([1.0, 0.5]) and place[1] == pytest.approx([1.0, 0.5])


def test_the_eighth_line_of_a_panel_has_the_first_colour_again():
    columns = {"time": TIMES, **{f"J{k}.angle": TIMES for k in range(len(COLOURS) + 1)}}
    lines = plot.plot(columns, []).axes[0].lines
    assert [line.get_color() for line in lines] == [*COLOURS, COLOURS[0]]


# --- vectors ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("vector", "says"),
    [
        ((0.0, 0.0, 0.0), "must have a length, got the zero vector"),
        ((0.0, 3e-41, 4e-41), "must be at least 1e-40 in size, got 5e-41"),
        ((3e40, 0.0, 4e40), "must be at most 1e[+]40 in size, got 5e[+]40"),
    ],
)
def test_vectors_without_a_direction(vector, says):
    with pytest.raises(ValueError, match=says):
        scene_fields.direction(vector)


@pytest.mark.parametrize("vector", [(1.0, 0.0, 0.0), (0.0, -2.0, 0.5), (0.0, 0.0, 3e-40)])
def test_vectors_with_a_direction(vector):
    assert scene_fields.direction(vector) == vector


# --- batches ------------------------------------------------------------------------------------------------
def test_starts_of_a_batch(monkeypatch):
    """The second of three scenes has no start; places smaller than rounding become zero, velocities that
    are given do not."""
    nb = 1
    places = np.arange(21.0).reshape(3, 7)
    first, last = np.array([1e-17, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]), np.arange(7.0) + 1.0
    rates, given = np.array([1e-17, 5.0, 0, 0, 0, 0]), np.array([1e-17, 0.0, 0, 0, 0, 0])
    starts: Any = SimpleNamespace(
        starts=lambda: [
            Start(first, rates, 0.25, 0.5, given),
            SceneError(["cannot start"]),
            Start(last, rates, 0.0, 0.0, 0 * given),
        ]
    )
    packs: Any = SimpleNamespace(
        start=places.copy, mass=np.ones((3, 6 * nb)), length=np.array([2.0, 1.0, 4.0])
    )
    seen: list[Any] = []

    def without_rounding(q: np.ndarray, v: np.ndarray, given: np.ndarray, length: np.ndarray) -> Any:
        seen.extend((q.tolist(), v.tolist(), given.tolist(), length.tolist()))
        return q + 100.0, v + 200.0

    monkeypatch.setattr(candidates, "without_rounding", without_rounding)
    found, q, v = candidates._starts(None, packs, starts)  # type: ignore[arg-type]
    assert seen == [
        [first.tolist(), last.tolist()],
        [rates.tolist()] * 2,
        [given.tolist(), [0.0] * 6],
        [2.0, 4.0],
    ]
    assert q.tolist() == [(first + 100.0).tolist(), places[1].tolist(), (last + 100.0).tolist()]
    assert v.tolist() == [(rates + 200.0).tolist(), [0.0] * 6, (rates + 200.0).tolist()]
    assert list(found) == [0, 2] and found[2].q is not last and found[2].q.tolist() == q[2].tolist()
    assert found[0].v.tolist() == v[0].tolist()
    nothing: Any = SimpleNamespace(starts=lambda: [SceneError(["cannot start"])] * 3)
    found, q, v = candidates._starts(None, packs, nothing)  # type: ignore[arg-type]
    assert found == {} and q.tolist() == places.tolist() and not v.any()


# --- joints -------------------------------------------------------------------------------------------------
def universal(first: Any, second: Any) -> Any:
    made = scene_joints.Universal(name="U", bodies=("a", "b"), anchor=(0.0, 0.0, 0.0), axes=(first, second))
    return made.axes


def test_the_second_axis_of_a_universal_joint_is_made_perpendicular():
    """(1.04, 2.02, 1.96) is (1, 2, 2) and a fiftieth of (2, 1, -2), which is perpendicular."""
    first, second = universal((2.0, 1.0, -2.0), (1.04, 2.02, 1.96))
    assert first == (2.0, 1.0, -2.0) and second == pytest.approx((1.0, 2.0, 2.0))


def test_axes_of_a_universal_joint_that_are_refused(monkeypatch):
    """The cosine of (3, 4, 0) and x is 3/5."""
    along, parallel = (0.9, 0.1, 0.2), (2.7, 0.30000000000000004, 0.6000000000000001)  # cosine 1 + 2e-16
    opposite = tuple(-x for x in parallel)
    for pair, angle in (
        (((3.0, 4.0, 0.0), X), "53.1"),
        (((-3.0, 4.0, 0.0), X), "127"),
        ((along, parallel), "0"),
        ((along, opposite), "180"),
    ):
        with pytest.raises(ValueError, match=f"must be perpendicular, but enclose {angle} degrees"):
            scene_joints.Universal._axes_are_perpendicular(pair)
    with pytest.raises(ValueError, match="zero vector"):
        scene_joints.Universal._axes_are_perpendicular((X, (0.0, 0.0, 0.0)))
    monkeypatch.setattr(scene_joints, "SKEW", 0.6)
    assert universal((3.0, 4.0, 0.0), X)[1] == pytest.approx((16 / 25, -12 / 25, 0.0))
    monkeypatch.setattr(scene_joints, "RIGHT_ANGLE", 0.6)
    assert universal((3.0, 4.0, 0.0), X)[1] == X


@pytest.mark.parametrize(
    ("ratio", "says"),
    [
        (0.0, "must not be 0, which would lock the second joint"),
        (-5e-41, "must be at least 1e-40 in size, got 5e-41"),
        (-2e40, "must be at most 1e[+]40 in size, got -?2e[+]40"),
    ],
)
def test_ratios_of_couplings_that_are_refused(ratio, says):
    with pytest.raises(ValueError, match=says):
        scene_joints.Coupling._ratio_is_not_zero(ratio)


def test_coordinates_of_couplings():
    """A cylindrical joint has two, a plane the angle alone; a slide has the displacement."""
    of = {name: joint.facts for name, joint in scene_joints.JOINT_TYPES.items()}
    chosen = scene_joints.default_coordinates
    assert chosen((of["cylindrical"], of["translational"]), False) == ("angle", "displacement")
    assert chosen((of["inline"], of["planar"]), False) == ("displacement", "angle")
    assert chosen((of["spherical"], of["revolute"]), False) == ("angle", "angle")
    assert chosen((of["revolute"], of["revolute"]), True) == ("angle", "displacement")
    coordinates = {name: facts.coordinates for name, facts in of.items() if facts.coordinates}
    assert coordinates == {
        "revolute": ("angle",),
        "translational": ("displacement",),
        "cylindrical": ("angle", "displacement"),
        "planar": ("angle",),
        "inline": ("displacement",),
    }


@pytest.mark.parametrize(
    ("kind", "rows", "translations", "rotations", "driven", "loaded"),
    [
        ("fixed", 6, 0, 0, None, ()),
        ("revolute", 5, 0, 1, "angle", ("angle",)),
        ("universal", 4, 0, 2, None, ()),
        ("spherical", 3, 0, 3, None, ()),
        ("translational", 5, 1, 0, "displacement", ("displacement",)),
        ("cylindrical", 4, 1, 1, "angle", ("angle", "displacement")),
        ("planar", 3, 2, 1, None, ()),
        ("inline", 2, 1, 3, None, ()),
        ("distance", 1, 2, 3, None, ()),
    ],
)
def test_facts_of_joints(kind, rows, translations, rotations, driven, loaded):
    facts = scene_joints.JOINT_TYPES[kind].facts
    assert (facts.rows, facts.free_translations, facts.free_rotations) == (rows, translations, rotations)
    assert (facts.driven, facts.loaded) == (driven, loaded)


# --- loads --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("points", "stiffness", "length", "faults"),
    [
        (((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), 2.0, 0.5, []),
        (((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), 2.0, 0.0, []),
        (((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), 0.0, 0.5, []),
        (((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), 2.0, 0.5, ["natural_length"]),
        (((0.0, 0.0, 1.0), (0.0, 0.0)), 2.0, 0.5, ["points"]),
        (((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), -2.0, 0.5, ["stiffness"]),
    ],
)
def test_faults_of_a_spring(points, stiffness, length, faults):
    """A spring without stiffness, or of no length, needs no direction; a faulty field is reported alone."""
    found: list[Any] = []
    try:
        scene_loads.Spring(bodies=("a", "b"), points=points, stiffness=stiffness, natural_length=length)
    except ValidationError as error:
        found = [fault["loc"][0] for fault in error.errors()]
    assert found == faults


# --- formats ------------------------------------------------------------------------------------------------
def test_a_file_is_readable_if_any_format_reads_it(monkeypatch):
    items = [SimpleNamespace(reads=(".a",)), SimpleNamespace(reads=(".b", ".c"))]
    monkeypatch.setattr(
        formats,
        "entry_points",
        lambda group: [SimpleNamespace(load=lambda item=item: item) for item in items],
    )
    found = {name: formats.is_readable(name) for name in ("x.a", "x.b", "x.c", "x.d", "x")}
    assert found == {"x.a": True, "x.b": True, "x.c": True, "x.d": False, "x": False}


# --- rounded numbers ----------------------------------------------------------------------------------------
EPSILON = 2.0**-52


@pytest.mark.parametrize(
    ("gap", "largest", "rows", "advised"),
    [
        (100 * EPSILON, 0.5, 1, False),
        (math.nextafter(100 * EPSILON, 1.0), 0.5, 1, True),
        (400 * EPSILON, 4.0, 1, False),
        (math.nextafter(400 * EPSILON, 1.0), 4.0, 300, True),
        (math.nextafter(1e-5, 0.0), 4.0, 1, True),
        (1e-5, 4.0, 1, False),
        (1e-6, 4.0, 301, False),
    ],
)
def test_gaps_of_rounded_numbers(monkeypatch, gap, largest, rows, advised):
    """A gap of 100 roundings of the largest coordinate, or of 1 m or rad, is of Newton's method."""
    monkeypatch.setattr(rounded_numbers, "gap_of", lambda run: gap)
    model, start = SimpleNamespace(m=rows), SimpleNamespace(q=np.array([0.25, -largest, 0.0]))
    run: Any = SimpleNamespace(model=model, start=start)
    says = f"a small motion opens redundant loops by {gap:.1g} m or rad" if advised else ""
    assert rounded_numbers.advice(run).partition(",")[0] == says


@pytest.mark.parametrize(
    ("rows", "aim", "gap", "moves"),
    [
        ([[1, 0, 0], [1, 0, 0], [0, 2, 0]], [0.0, 0.02, 4.0], 0.01, [0.0, 0.0, 0.1]),
        ([[1, 0, 0], [2, 0, 0]], [0.0, 0.05], 0.02, [0.0, 0.1, 0.1]),
        ([[1, 0, 0], [0, 2, 0]], [1.0, 4.0], 0.0, None),
        ([[1, 0, 0], [0, 2, 0], [0, 0, 1], [0, 0, 1]], [1.0, 4.0, 0.0, 1.0], 0.0, None),
    ],
)
def test_the_gap_of_rows_that_contradict_each_other(monkeypatch, rows, aim, gap, moves):
    """Rows x = 0 and x = 0.02 leave 0.01 open, x = 0 and 2 x = 0.05 leave 0.02; rows that are independent, or
    leave no freedom, leave no gap."""
    jacobian, moved = np.array(rows, dtype=float), list[Any]()

    def terms(t: float, q: np.ndarray, v: np.ndarray) -> Any:
        assert t == 0.0 and v.tolist() == [0.0] * 3
        return SimpleNamespace(jacobian=jacobian, phi=jacobian @ q - aim)

    def displaced(q: np.ndarray, change: np.ndarray) -> np.ndarray:
        moved.append(change)
        return q + change

    def scaled(model: Any, t: float, q: np.ndarray) -> np.ndarray:
        assert t == 0.0 and q.tolist() == [1.0, 1.0, 1.0]
        return jacobian

    monkeypatch.setattr(rounded_numbers, "scaled_jacobian", scaled)
    monkeypatch.setattr(rounded_numbers, "displaced", displaced)
    start = SimpleNamespace(q=np.ones(3))
    run: Any = SimpleNamespace(model=SimpleNamespace(n=3, m=len(rows), terms=terms), start=start)
    assert rounded_numbers.gap_of(run) == pytest.approx(gap, abs=1e-12)
    assert len(moved) == (0 if moves is None else 13)
    if moves is not None:
        assert np.abs(moved[0]).max() == pytest.approx(0.1) and moved[0][0] == 0.0
        assert (moved[0] != 0.0).tolist() == [move != 0.0 for move in moves]


# --- defaults -----------------------------------------------------------------------------------------------
ZERO = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("of", "defaults"),
    [
        (Scene, {"gravity": ZERO, "duration": 1.0, "ground": "frame", "joint": (), "load": ()}),
        (Body, {"mass": None, "orientation": (1.0, 0.0, 0.0, 0.0), "velocity": None}),
        (Driver, {"polynomial": (0.0,), "sine": None, "table": None}),
        (Sine, {"amplitude": 0.0, "frequency": 1.0, "phase": 0.0}),
        (Factor, {"polynomial": None, "start": 0.0, "stop": None}),
        (scene_joints.Revolute, {"armature": 0.0}),
        (scene_joints.Translational, {"armature": 0.0}),
        (scene_joints.Coupling, {"offset": 0.0, "coordinates": None}),
        (scene_loads.Spring, {"damping": 0.0}),
        (scene_loads.TorsionSpring, {"damping": 0.0, "natural_angle": 0.0}),
        (scene_loads.SlideSpring, {"damping": 0.0, "natural_displacement": 0.0}),
    ],
)
def test_defaults_of_entries(of, defaults):
    fields = of.model_fields
    assert {name: fields[name].default for name in defaults} == defaults
    assert of.model_config["frozen"] and of.model_config["extra"] == "forbid"


@pytest.mark.parametrize(
    ("of", "defaults"),
    [
        (Form, {"width": 720.0, "margin": 64.0, "tallest": 520.0, "letters": 12, "columns": 1}),
        (Look, {"colour": "", "thickness": 6.0, "opacity": 1.0}),
        (scene_loads.Action, {"stiffness": 0.0, "damping": 0.0, "natural": 0.0, "amount": 0.0}),
    ],
)
def test_defaults_of_tuples(of, defaults):
    assert of()._asdict() == defaults


@pytest.mark.parametrize(
    ("of", "defaults"),
    [
        (
            Cost,
            {
                "seconds": 0.0,
                "build_seconds": 0.0,
                "steps": 0,
                "rejected": 0,
                "rhs": 0,
                "factorisations": 0,
                "newton": 0,
            },
        ),
        (Trajectory, {"t_end": 0.0, "message": "", "crossings": None, "reactions": None}),
        (Equilibrium, {"rate": 0.0}),
        (Ended, {"seconds": 0.0}),
        (Variation, {"normal": False}),
        (Timeline, {"marks": (), "label": ""}),
    ],
)
def test_defaults_of_records(of, defaults):
    found = {field.name: field.default for field in dataclasses.fields(of)}
    assert {name: found[name] for name in defaults} == defaults


def test_the_scene_of_a_motion_is_given_by_name():
    fields = {field.name: field for field in dataclasses.fields(Motion)}
    assert fields["mechanism"].kw_only and fields["mechanism"].default is dataclasses.MISSING


# --- functions of time --------------------------------------------------------------------------------------
TABLE = ((0.0, 1.0), (1.0, 2.0), (2.0, 9.0), (3.0, 28.0))  # 1 + t³


def test_coefficients_of_factors():
    assert Factor().coefficients == (1.0,) and Factor(start=1.0, stop=2.0).coefficients == (1.0,)
    assert Factor(sine=Sine(amplitude=2.0)).coefficients == (0.0,)
    assert Factor(table=TABLE).coefficients == (0.0,)
    assert Factor(sine=Sine(amplitude=2.0), polynomial=(3.0, 4.0)).coefficients == (3.0, 4.0)
    assert Factor().interval == (0.0, math.inf) and Factor(start=1.0, stop=2.0).interval == (1.0, 2.0)
    assert Driver(joint="A").interval == (-math.inf, math.inf)


def test_values_of_a_switched_table():
    """2 + sin t + 1 + t³ from 0.5 s until before 2.5 s; nothing before and after."""
    factor = Factor(polynomial=(2.0,), sine=Sine(amplitude=1.0), table=TABLE, start=0.5, stop=2.5)
    times = np.array([0.0, 0.25, 0.5, 1.0, 1.5, 2.25, 2.5, 3.0])
    values = np.where((times >= 0.5) & (times < 2.5), 3.0 + np.sin(times) + times**3, 0.0)
    assert factor.values(times) == pytest.approx(values)
    begins = [(piece.begin, piece.part) for piece in factor.pieces()]
    assert begins == [(0.0, 0.0), (0.5, 1.0), (1.0, 1.0), (2.0, 1.0), (2.5, 0.0)]
    assert factor.pieces()[1].cubic == pytest.approx((1.125, 0.75, 1.5, 1.0)), "1 + (0.5 + s)³"
    assert factor.pieces()[2].cubic == pytest.approx((2.0, 3.0, 3.0, 1.0)), "1 + (1 + s)³"
    assert factor.pieces()[4].cubic == (0.0, 0.0, 0.0, 0.0)
    shifted = Factor(table=tuple((t - 1.5, x) for t, x in TABLE), start=0.0)
    assert [piece.begin for piece in shifted.pieces()] == [0.0, 0.5]
    assert shifted.pieces()[0].cubic == pytest.approx((4.375, 6.75, 4.5, 1.0)), "1 + (1.5 + s)³"


@pytest.mark.parametrize(
    ("factor", "constant"),
    [
        (Factor(), True),
        (Factor(polynomial=(2.0, 0.0)), True),
        (Factor(polynomial=(2.0, 1.0)), False),
        (Factor(sine=Sine(amplitude=0.0, frequency=3.0)), True),
        (Factor(sine=Sine(amplitude=1.0)), False),
        (Factor(table=TABLE), False),
        (Factor(start=0.5), False),
        (Factor(stop=0.5), False),
    ],
)
def test_factors_that_never_change(factor, constant):
    assert factor.is_constant == constant


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"stop": 1.0, "start": 1.0}, "must be later than start, 1 s, got 1"),
        ({"stop": 0.5, "start": 1.0}, "must be later than start, 1 s, got 0.5"),
        ({"table": TABLE[:3]}, r"must have at least 4 rows \[time, value\], got 3"),
        ({"table": (*TABLE[:3], (2.0, 0.0))}, "times must increase, but row 3 is at 2 s and row 2 at 2 s"),
    ],
)
def test_functions_that_are_refused(fields, says):
    with pytest.raises(ValidationError, match=says):
        Factor(**fields)


# --- rotations ----------------------------------------------------------------------------------------------
P, Q = np.array([0.1, -0.7, 0.5, 0.5]), np.array([0.8, 0.4, -0.2, 0.4])  # of unit length


def turned(p: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The vector part of p v p*: v + 2 w (u × v) + 2 u × (u × v)."""
    w, u = p[0], p[1:]
    return v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))


def test_matrices_and_products_of_quaternions():
    for p in (P, Q):
        columns = np.stack([turned(p, axis) for axis in np.eye(3)], axis=1)
        assert rotations.to_matrix(p) == pytest.approx(columns)
        sign = 1.0 if p[0] >= 0 else -1.0
        assert rotations.from_matrix(columns) == pytest.approx(sign * p)
        assert rotations.conjugate(p).tolist() == [p[0], -p[1], -p[2], -p[3]]
    product = rotations.multiply(P, Q)
    vector = P[0] * Q[1:] + Q[0] * P[1:] + np.cross(P[1:], Q[1:])
    assert product == pytest.approx([P[0] * Q[0] - P[1:] @ Q[1:], *vector])
    both = rotations.multiply(np.stack([P, Q]), Q)
    assert both.shape == (2, 4) and both[0] == pytest.approx(product)


@pytest.mark.parametrize("k", range(4))
def test_quaternions_whose_largest_entry_is_each(k):
    """Of half turns and others, also from a stack of matrices; entry 0 is not negative."""
    p = np.array([0.1, 0.3, -0.5, 0.2])
    p[k] = 2.0
    p /= np.linalg.norm(p)
    matrices = np.stack([rotations.to_matrix(p), np.eye(3)])
    found = rotations.from_matrix(matrices)
    assert found == pytest.approx(np.array([p, [1.0, 0.0, 0.0, 0.0]]), abs=1e-15)
    p[0] = -p[0]
    assert rotations.from_matrix(rotations.to_matrix(p)) == pytest.approx(-p)


def test_products_and_directions_of_vectors():
    a, b = np.array([[1.0, 2.0, 3.0], [0.0, 1.0, 0.0]]), np.array([[-2.0, 0.5, 4.0], [0.0, 0.0, 2.0]])
    assert rotations.cross(a, b) == pytest.approx(np.cross(a, b))
    whole = rotations.cross(np.array([1, 2, 3]), np.array([3, 2, 1]))
    assert whole.tolist() == [-4.0, 8.0, -4.0] and whole.dtype == float
    assert rotations.unit([0.0, -3.0, 4.0]) == pytest.approx([0.0, -0.6, 0.8])
    assert rotations.unit([0.0, 0.0]).tolist() == [0.0, 0.0]
    turn = rotations.from_vector(np.array([[0.0, 0.0, 0.6], [0.0, -0.8, 0.0]]))
    expected = [[math.cos(0.3), 0, 0, math.sin(0.3)], [math.cos(0.4), 0, -math.sin(0.4), 0]]
    assert turn == pytest.approx(np.array(expected))
    assert rotations.to_vector(-turn) == pytest.approx(np.array([[0.0, 0.0, 0.6], [0.0, -0.8, 0.0]]))
    assert rotations.angle_between(turn[0], -turn[1]) == pytest.approx(
        2 * math.acos(math.cos(0.3) * math.cos(0.4))
    )
    assert rotations.rotate(turn[0], X) == pytest.approx([math.cos(0.6), math.sin(0.6), 0.0])


# --- simulation ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("times", "says"),
    [
        (["x"], "times: must be numbers"),
        (None, "times: needs at least one sample time|times: must be finite"),
        ([], "times: needs at least one sample time"),
        ([[0.0, 1.0]], "times: needs at least one sample time"),
        ([0.0, 2.0, 1.0], "times: must be finite, not negative and increasing"),
        ([0.0, 1.0, 1.0], "times: must be finite, not negative and increasing"),
        ([-0.5, 1.0], "times: must be finite, not negative and increasing"),
        ([0.0, math.nan, 1.0], "times: must be finite, not negative and increasing"),
        ([0.0, math.inf], "times: must be finite, not negative and increasing"),
    ],
)
def test_sample_times_that_are_refused(times, says):
    with pytest.raises(InputError, match=says):
        simulate.checked_times(times)


def test_sample_times_that_are_taken():
    assert simulate.checked_times([0, 1, 3]).tolist() == [0.0, 1.0, 3.0]
    assert simulate.checked_times((0.5,)).dtype == float


@pytest.mark.parametrize(
    ("branches", "passed", "says"),
    [
        ({}, 0, ""),
        ({2: 1}, 2, ""),
        ({1: 2, 3: 2}, 2, "the motion passes 2 singular positions up to t = 2.5 s, and no number 3"),
        ({2: 1}, 1, "the motion passes 1 singular position up to t = 2.5 s, and no number 2"),
        ({1: 1}, 0, "the motion passes 0 singular positions up to t = 2.5 s, and no number 1"),
    ],
)
def test_branches_at_positions_that_are_not_passed(branches, passed, says):
    limits, times = SimpleNamespace(branches=tuple(branches.items())), np.array([0.0, 2.5])
    run: Any = SimpleNamespace(limits=limits, crossings=[None] * passed, times=times)
    with pytest.raises(InputError) if says else contextlib.nullcontext() as fault:
        simulate._check_branches(run)
    assert not says or str(fault.value) == f"branches: {says}"
