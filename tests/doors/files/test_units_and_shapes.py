"""Numbers with units equal the SI numbers to the last digit; shapes give mass and moments by integration."""

import json
import math
import tomllib

import numpy as np
import pytest

from mbref.cli.scene_files import schema
from mbref.scene import JOINT_TYPES, Scene, SceneError

PRESS = Scene(
    **tomllib.loads("""
name = "press"
body = [
  {name = "arm", mass = 1, inertia = [1, 1, 1], position = [0.3, 0, 0]},
  {name = "ram", mass = 1, inertia = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], position = [1, 0, 0]},
]
joint = [
  {name = "A", type = "revolute", bodies = ["ground", "arm"], anchor = [0, 0, 0], axis = [0, 0, 1]},
  {name = "C", type = "translational", bodies = ["ground", "ram"], anchor = [1, 0, 0], axis = [1, 0, 0]},
  {name = "E", type = "distance", bodies = ["arm", "ram"], anchors = [[0.6, 0, 0], [1, 0, 0]]},
]
coupling = [{name = "screw", joints = ["A", "C"], ratio = 1.0}]
driver = [{joint = "A", sine = {amplitude = 1.0}}]
load = [
  {type = "moment", body = "arm", moment = [0, 0, 1]},
  {type = "force", body = "ram", point = [1, 0, 0], force = [1, 0, 0], factor = {start = 0.1}},
  {type = "spring", bodies = ["arm", "ram"], points = [[0,0,0], [1,0,0]], stiffness = 1, natural_length = 0},
  {type = "torsion_spring", joint = "A", stiffness = 1.0},
  {type = "slide_spring", joint = "C", stiffness = 1.0},
  {type = "joint_torque", joint = "A", torque = 1.0},
  {type = "joint_force", joint = "C", force = 1.0},
]
""")
)
VALUES = [  # path, value with units, numbers in SI
    ("gravity", [0.0, "-9810 mm/s^2", "0 m/s²"], [0.0, -9.81, 0.0]),
    ("duration", "250 ms", 0.25),
    ("body[arm].mass", "500 g", 0.5),
    ("body[arm].inertia", ["300 kg mm^2", "450 kg*mm²", "5 kg cm**2"], [3e-4, 4.5e-4, 5e-4]),
    ("body[ram].inertia[1]", [0, "20 kg·cm²", 0], [0, 2e-3, 0]),
    ("body[arm].position", ["12 in", "50mm", 0.0], [0.3048, 0.05, 0.0]),
    ("body[arm].velocity", [0.0, "30 mm/s", "3 m/min"], [0.0, 0.03, 0.05]),
    ("body[arm].angular_velocity", [0.0, 0.0, "60 rpm"], [0.0, 0.0, 2 * math.pi]),
    ("joint[A].armature", "20 kg mm^2", 2e-5),
    ("joint[C].armature", "40 g", 0.04),
    ("joint[E].anchors", [["60 cm", 0.0, 0.0], ["1 m", 0, 0]], [[0.6, 0.0, 0.0], [1, 0, 0]]),
    ("coupling[screw].ratio", "5 mm/rev", 0.005 / (2 * math.pi)),
    ("coupling[screw].offset", "2 mm", 0.002),
    ("driver[A].polynomial", ["0 deg", "60 rpm", "0.5 rad/s^2"], [0.0, 2 * math.pi, 0.5]),
    ("driver[A].sine.amplitude", "30 deg", math.pi / 6),
    ("driver[A].sine.frequency", "2 Hz", 4 * math.pi),
    ("driver[A].sine.phase", "1 rev", 2 * math.pi),
    ("load[0].moment", [0.0, 0.0, "500 N mm"], [0.0, 0.0, 0.5]),
    ("load[1].force", ["2.5 kN", 0.0, 0.0], [2500.0, 0.0, 0.0]),
    ("load[1].factor.start", "20 ms", 0.02),
    ("load[1].factor.stop", "200 ms", 0.2),
    (
        "load[1].factor.table",
        [["0 s", 1], ["0.1 s", 2], ["200 ms", 1], [1, 0]],
        [[0, 1], [0.1, 2], [0.2, 1], [1, 0]],
    ),
    ("load[2].stiffness", "2 N/mm", 2000.0),
    ("load[2].damping", "0.05 N s/mm", 50.0),
    ("load[2].natural_length", "900 mm", 0.9),
    ("load[3].stiffness", "20 N mm/deg", 3.6 / math.pi),
    ("load[3].damping", "5 N mm s/rad", 0.005),
    ("load[3].natural_angle", "45 deg", math.pi / 4),
    ("load[4].stiffness", "0.7 N/mm", 700.0),
    ("load[4].damping", "5 N s/m", 5.0),
    ("load[4].natural_displacement", "1 mm", 0.001),
    ("load[5].torque", "200 Nmm", 0.2),
    ("load[6].force", "-1 lbf", -4.4482216152605),
]


def numbers(data):
    """Return all values in nested tables, in order."""
    if isinstance(data, dict | list):
        return [x for value in (data.values() if isinstance(data, dict) else data) for x in numbers(value)]
    return [data]


@pytest.mark.parametrize(("path", "text", "number"), VALUES, ids=[path for path, *_ in VALUES])
def test_number_with_a_unit_is_the_number_in_si_to_the_last_digit(path, text, number):
    """A scene with the text has the numbers of a scene with the SI number of VALUES. If the factor has π, the
    product may be rounded once more, by 2.3e-16."""
    read, right = (numbers(PRESS.with_(path, value).to_dict()) for value in (text, number))
    for mine, other in zip(read, right, strict=True):
        assert mine == other or math.isclose(mine, other, rel_tol=2.3e-16)


def test_every_number_may_have_a_unit_except_directions_and_pure_numbers():
    """The schema allows a text wherever a number may have a unit. ``pure`` lists pure numbers: quaternions,
    coefficients of loads and of restitution. Axes, normals and lines of joints are directions."""
    whole = schema()
    fields = {
        f"{table}.{field}"
        for table, entry in {"Scene": whole, **whole["$defs"]}.items()
        for field, kind in entry["properties"].items()
        if '"number"' in json.dumps(kind) and '"string"' not in json.dumps(kind)
    }
    along = {"axis", "axes", "normal", "along"}
    axes = {f"{joint.__name__}.{field}" for joint in JOINT_TYPES.values() for field in along}
    pure = {"Body.orientation", "Driver.along", "Turn.axis", "Factor.polynomial", "Stop.restitution"}
    assert fields - axes == pure


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("body[arm].mass", "2 N", "such as \"500 g\", got '2 N'; 'N' is no unit of mass, known: kg"),
        ("gravity", [0, "9.81 m/s", 0], "no unit of acceleration"),
        ("joint[C].armature", "3 kg m^2", "no unit of mass"),
        ("load[3].stiffness", "3 N m", "no unit of torsional stiffness"),
        ("load[3].damping", "3 N m/rad s", "no unit of torsional damping"),
        ("coupling[screw].ratio", "5 rev/mm", r"coupling\[screw\].ratio: is in m/rad, got '5 rev/mm'"),
        ("coupling[screw].offset", "5 deg", "offset: is of the displacement of 'C', got '5 deg'"),
        ("driver[A].polynomial", [0, 0, "60 rpm"], r"polynomial\[2\]: .* of angle, also over s\^2, got '60"),
        ("load[1].factor.table", [[0, "1 N"], [0.1, 2], [0.2, 1], [0.3, 0]], "multiplies the load"),
        ("load[1].factor.table", [["0 s", 1], ["0.1 s", 2], [0.2, 1], ["190 ms", 0]], "times must increase"),
        ("driver[A].table", [[0, 0], [1, "1 deg"], ["2 s", "2 mm"], [3, 0]], r"table\[2\]\[1\]: .* angle"),
    ],
)
def test_unit_of_another_quantity_is_refused_with_the_field(path, value, message):
    """Each field of the press takes units of one quantity; times of a table increase in any unit."""
    with pytest.raises(SceneError, match=message):
        PRESS.with_(path, value)


def grid(*bounds, points=8):
    """Return nodes (n, 3) and weights (n,) of Gauss-Legendre quadrature over a box of parameters."""
    node, weight = np.polynomial.legendre.leggauss(points)
    axes = [(low + (high - low) * (node + 1) / 2, weight * (high - low) / 2) for low, high in bounds]
    nodes = np.stack(np.meshgrid(*(axis for axis, _ in axes), indexing="ij"), axis=-1).reshape(-1, 3)
    return nodes, np.prod(np.meshgrid(*(w for _, w in axes), indexing="ij"), axis=0).ravel()


def solid(shape):
    """Return points (n, 3) and volumes (n,) whose sums are integrals over a shape, up to second order."""
    if shape["type"] == "box":
        return grid(*((-edge / 2, edge / 2) for edge in shape["size"]))
    if shape["type"] == "sphere":
        nodes, volumes = grid((0, shape["radius"]), (-1, 1), (0, 2 * math.pi), points=24)
        r, cosine, turn = nodes.T
        sine = np.sqrt(1 - cosine**2)
        return np.stack([r * sine * np.cos(turn), r * sine * np.sin(turn), r * cosine], 1), volumes * r**2
    inner, half = shape.get("inner_radius", 0.0), shape["length"] / 2
    nodes, volumes = grid((inner, shape["radius"]), (0, 2 * math.pi), (-half, half), points=24)
    r, turn, z = nodes.T
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1), volumes * r


@pytest.mark.parametrize(
    "shape",
    [
        {"type": "box", "size": [0.3, 0.04, 0.02]},
        {"type": "sphere", "radius": 0.05},
        {"type": "cylinder", "axis": "z", "length": 0.2, "radius": 0.03},
        {"type": "tube", "axis": "z", "length": 0.2, "radius": 0.03, "inner_radius": 0.028},
    ],
    ids=lambda shape: shape["type"],
)
def test_mass_and_moments_of_a_shape_are_its_integrals(shape):
    """∫ ρ dV and ∫ ρ (|r|² δ − r r) dV by quadrature, which is exact to rounding."""
    points, volumes = solid(shape)
    mass = float(7850 * volumes.sum())
    moments = 7850 * volumes @ ((points**2).sum(axis=1)[:, None] - points**2)
    body = {"name": "b", "position": [0, 0, 0], "shape": shape, "density": "7.85 g/cm^3"}
    [found] = Scene(name="s", body=[body]).body
    assert found.mass == pytest.approx(mass, rel=1e-13)
    assert found.inertia == pytest.approx(tuple(moments), rel=1e-12)


def test_moments_of_a_rod_are_those_of_a_line():
    """m l² / 12 across the axis and 0 about it: 3 kg and 200 mm."""
    rod = {"type": "rod", "axis": "x", "length": "200 mm"}
    [found] = Scene(name="s", body=[{"name": "b", "position": [0, 0, 0], "shape": rod, "mass": 3.0}]).body
    assert found.inertia == pytest.approx((0.0, 0.01, 0.01), rel=1e-12)


BALL = {"type": "sphere", "radius": 1}
ROD = {"type": "rod", "axis": "x", "length": 1}
NO_WALL = {"type": "tube", "radius": 0.1, "inner_radius": 0.1}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"shape": {"type": "ball", "radius": 1}, "mass": 1}, "shape.type: must be one of 'box', 'sphere'"),
        ({"shape": {"type": "box", "size": [1, 1, "0 mm"]}, "mass": 1}, r"shape.size\[2\]: must be positive"),
        ({"shape": {"type": "rod", "length": 1}, "mass": 1}, "shape.axis: is required"),
        ({"shape": {**ROD, **NO_WALL}, "mass": 1}, "less than radius"),
        ({"shape": BALL}, "mass: is missing; a shape needs mass or density"),
        ({"shape": BALL, "mass": 1, "density": 1}, "density, not both"),
        ({"shape": BALL, "mass": 1, "inertia": [1, 1, 1]}, "inertia: follows from the shape"),
        ({"shape": ROD, "density": 1}, "density: needs a volume"),
        ({"mass": 1, "inertia": [1, 1, 1], "density": 1}, "a density needs a shape"),
    ],
)
def test_shape_that_gives_no_inertia_is_refused(fields, message):
    """An unknown shape, a size of zero, a missing field, a tube without wall, mass and density at once or
    neither of them, an inertia beside a shape, and a density without a volume or a shape."""
    with pytest.raises(SceneError, match=r"body\[b\]\..*" + message):
        Scene(name="s", body=[{"name": "b", "position": [0, 0, 0], **fields}])
