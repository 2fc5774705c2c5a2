"""Built-in scenes / masses, inertias, velocities and anchors of their published data, worked out by hand.

A rod from a to b has ∫ r rᵀ dm = m (a aᵀ + b bᵀ + (a + b)(a + b)ᵀ) / 6, and m s² across it for a section of
radius of gyration s.  The inertia of a mechanism about the origin is the sum of tr(S) 1 - S over its parts.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from mbref import rotations
from mbref.scene import Scene, SceneError
from mbref.scenes import SCENES, find_scene
from mbref.scenes.four_bar import two_rhombi

DOWN_Y, DOWN_Z, NONE = (0.0, -9.81, 0.0), (0.0, 0.0, -9.81), (0.0, 0.0, 0.0)
ROUND, SQUARE = 0.01 / 2, 0.1 / math.sqrt(12)  # radii of gyration of the paper's rods and of Bricard's, m
Part = tuple[float, np.ndarray, np.ndarray]  # mass, first moment, second moment about the origin


def rod(mass: float, start, end, section: float = ROUND) -> Part:
    a, b = np.array(start, float), np.array(end, float)
    u = (b - a) / np.linalg.norm(b - a)
    along = mass / 6 * (np.outer(a, a) + np.outer(b, b) + np.outer(a + b, a + b))
    return mass, mass * (a + b) / 2, along + mass * section**2 * (np.eye(3) - np.outer(u, u))


def lump(mass: float, place, *moments: float) -> Part:
    """A body with principal moments along the axes of the world."""
    r, inertia = np.array(place, float), np.array(moments or (0.0, 0.0, 0.0))
    return mass, mass * r, mass * np.outer(r, r) + np.diag(inertia.sum() / 2 - inertia)


def slider(*place: float) -> Part:
    return lump(1.0, place, 1e-3, 1e-3, 1e-3)


def on_crank(r: float, theta: float, z: float = 0.0) -> tuple[float, float, float]:
    return r * math.cos(theta), r * math.sin(theta), z


def rhombus(theta: float, has_bar: bool = False) -> list[Part]:
    (x, y, _), rods = on_crank(0.5, theta), []
    if has_bar:
        rods = [rod(0.5, (x / 2, y / 2, 0), (0.5 + x / 2, y / 2, 0))]
    return [
        rod(0.5, (0, 0, 0), (x, y, 0)),
        rod(0.5, (x, y, 0), (0.5 + x, y, 0)),
        rod(0.5, (0.5, 0, 0), (0.5 + x, y, 0)),
        *rods,
    ]


def planar(a: float, b: float, theta: float, z: float = 0.0) -> list[Part]:
    pin = on_crank(a, theta, z)
    end = (pin[0] + math.sqrt(b**2 - pin[1] ** 2), 0.0, z)
    return [rod(a, (0, 0, z), pin), rod(b, pin, end), slider(*end)]


def spatial(theta: float) -> list[Part]:
    pin = (0.1 * math.cos(theta), 0.0, -0.1 * math.sin(theta))
    end = (0.15, math.sqrt(0.4**2 - (pin[0] - 0.15) ** 2 - pin[2] ** 2), 0.0)
    return [rod(0.1, (0, 0, 0), pin), rod(0.4, pin, end), slider(*end)]


def upright_links(loops: int) -> list[Part]:
    """Links of 1 m and 1 kg with 1/12 kg m² across them and 1e-3 about them: less than a rod's along them."""
    section = math.sqrt(5e-4)
    stands = [((i, 0, 0), (i, 1, 0)) for i in range(loops + 1)]
    tops = [((i, 1, 0), (i + 1, 1, 0)) for i in range(loops)]
    parts = [rod(1.0, a, b, section) for a, b in (*stands, *tops)]
    less = [5e-4 * np.diag(axis) for axis in [(0, 1, 0)] * len(stands) + [(1, 0, 0)] * len(tops)]
    return [(m, first, second - s) for (m, first, second), s in zip(parts, less, strict=True)]


def cube_edges(section: float) -> list[Part]:
    corners = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
    return [rod(1.0, a, b, section) for a, b in itertools.pairwise(corners)]


def governor() -> list[Part]:
    """Rods of 0.3 kg, arms 30° below the horizontal with balls of 5 kg, a cube of 3 kg."""
    thin, c = 0.01 / math.sqrt(12), math.cos(math.radians(30))
    ends = [((s * 0.05, 0, 1.0), (s * (0.05 + c), 0, 0.5)) for s in (1, -1)]
    arms = [part for a, b in ends for part in (rod(0.3, a, b, thin), lump(5.0, b))]
    return [rod(0.3, (0, 0, 0), (0, 0, 1), thin), lump(3.0, (0, 0, 0.5), *(3.0 * 0.01 / 6,) * 3), *arms]


def haug(centre: tuple[float, float, float]) -> list[Part]:
    """Crank 0.08 m above (0, 0.1, 0.12), rod of 0.3 m to the x axis: its end is at x = 0.2 m."""
    pin, end = np.array([0.0, 0.1, 0.2]), np.array([0.2, 0.0, 0.0])
    u, middle = (end - pin) / 0.3, (pin + end) / 2
    inertia = 4e-3 * np.eye(3) + (4e-4 - 4e-3) * np.outer(u, u)
    second = np.trace(inertia) / 2 * np.eye(3) - inertia + 0.5 * np.outer(middle, middle)
    crank = lump(0.12, centre, 1e-4, 1e-4, 1e-5)
    return [crank, (0.5, 0.5 * middle, second), lump(2.0, end, 1e-4, 1e-4, 1e-4)]


def sarrus() -> list[Part]:
    rise, reach = 0.5 * math.sqrt(0.75), 0.25
    feet = [(0.2, 0.0), (0.2 + reach, rise), (0.2, 2 * rise)]
    sides = [[(r, 0, z) for r, z in feet], [(0, r, z) for r, z in feet]]
    bars = [rod(0.5, a, b) for side in sides for a, b in itertools.pairwise(side)]
    return [*bars, lump(1.0, (0, 0, 2 * rise), 0.01, 0.01, 0.01)]


def flywheel(length: float) -> list[Part]:
    return [*planar(length, length, 0.0), (0.0, np.zeros(3), np.diag([104.125 / 2, 104.125 / 2, 0.0]))]


WHOLE_TURN, RISING = 2 * math.pi, math.sqrt(0.4**2 - 0.05**2)
TABLE = {  # name: parts, gravity, duration
    "four_bar": (rhombus(math.pi / 2), NONE, 0.1),
    "four_bar_quarter": (rhombus(math.pi / 4), NONE, 0.1),
    "four_bar_straight": (rhombus(math.pi), NONE, 0.1),
    "four_bar_gravity": (rhombus(0.3), DOWN_Y, 1.0),
    "five_bar": (rhombus(math.pi / 2, True), NONE, 0.1),
    "five_bar_gravity": (rhombus(0.3, True), DOWN_Y, 1.0),
    "spatial_slider_crank": (spatial(0.0), NONE, 0.05),
    "spatial_slider_crank_driven": (spatial(0.0), NONE, 0.2),
    "spatial_slider_crank_gravity": (spatial(0.3), DOWN_Y, 0.5),
    "planar_slider_crank": (planar(0.304, 0.4048, 0.0), NONE, 0.4),
    "planar_slider_crank_equal": (planar(0.308, 0.308, 0.0), NONE, 0.2),
    "planar_slider_crank_heavy": (flywheel(0.308), NONE, 20.0),
    "planar_slider_crank_gravity": (planar(0.304, 0.4048, 0.3), DOWN_Y, 1.0),
    "four_bar_chain": (upright_links(2), DOWN_Y, 0.5),
    "four_bar_chain[3]": (upright_links(3), DOWN_Y, 0.5),
    "slider_crank_chain": (
        [p for i in (1, 2) for p in planar(0.304, 0.4048, 0.3 + i * WHOLE_TURN / 3, 0.1 * i)],
        DOWN_Y,
        0.2,
    ),
    "point_pendulum": ([lump(1.0, (-1, 0, 0))], DOWN_Y, 10.0),
    "bricard": (cube_edges(SQUARE), DOWN_Y, 10.0),
    "bricard_thin": (cube_edges(0.0), DOWN_Y, 10.0),
    "flyball_governor": (governor(), DOWN_Z, 10.0),
    "rigid_slider_crank": (haug((0.0, 0.1, 0.12)), DOWN_Z, 5.0),
    "rigid_slider_crank_middle": (haug((0.0, 0.1, 0.16)), DOWN_Z, 5.0),
    "heavy_top": ([lump(15.0, (0, 1, 0), 0.234375, 0.46875, 0.234375)], DOWN_Z, 2.0),
    "sarrus": (sarrus(), DOWN_Z, 0.3),
    "h_frame": (
        [lump(2.0, (0.4, 0, 0), 0.2, 0.05, 0.24), lump(5.0, (0.8, 0.25, 0), 0.02, 0.02, 0.02)],
        DOWN_Z,
        1.0,
    ),
}
ANCHORS = {  # the points of the joints
    "four_bar": [(0, 0, 0), (0, 0.5, 0), (0.5, 0.5, 0), (0.5, 0, 0)],
    "five_bar": [(0, 0, 0), (0, 0.5, 0), (0.5, 0.5, 0), (0.5, 0, 0), (0, 0.25, 0), (0.5, 0.25, 0)],
    "spatial_slider_crank": [(0, 0, 0), (0.1, 0, 0), (0.15, RISING, 0), (0.15, RISING, 0)],
    "planar_slider_crank": [(0, 0, 0), (0.304, 0, 0), (0.7088, 0, 0), (0.7088, 0, 0)],
    "bricard": [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)],
    "flyball_governor": [(0, 0, 0), (0, 0, 0.5), (0.05, 0, 1), (-0.05, 0, 1)],
    "rigid_slider_crank": [(0, 0.1, 0.12), (0, 0.1, 0.2), (0.2, 0, 0), (0.2, 0, 0)],
    "h_frame": [(0, 0.5, 0), (0, -0.5, 0), (0.8, 0.25, 0)],
}


def parts_of(scene: Scene) -> Part:
    """Mass, first moment and inertia about the origin of all bodies together."""
    mass, first, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    for body in scene.body:
        r, turn = np.array(body.position), rotations.to_matrix(np.array(body.orientation))
        mass, first = mass + body.mass, first + body.mass * r
        own = turn @ np.diag(body.inertia) @ turn.T
        inertia += own + body.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return mass, first, inertia


@pytest.mark.parametrize("name", TABLE)
def test_masses_gravity_and_duration(name):
    parts, gravity, duration = TABLE[name]
    scene = find_scene(name)
    mass, first, inertia = parts_of(scene)
    second = sum(part[2] for part in parts)
    assert scene.name == name and scene.gravity == gravity and scene.duration == duration
    assert mass == pytest.approx(sum(part[0] for part in parts), rel=1e-14)
    assert np.allclose(first, sum(part[1] for part in parts), rtol=0, atol=1e-14)
    assert np.allclose(inertia, np.trace(second) * np.eye(3) - second, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("name", ANCHORS)
def test_points_of_joints(name):
    found = [joint.anchor_pair[0] for joint in SCENES[name]().joint]
    assert np.allclose(found, ANCHORS[name], rtol=0, atol=1e-15)


def test_turning_and_driven_bodies():
    spins = {
        name: {b.name: b.angular_velocity for b in SCENES[name]().body if b.angular_velocity is not None}
        for name in (
            "four_bar",
            "planar_slider_crank_gravity",
            "spatial_slider_crank_gravity",
            "rigid_slider_crank",
        )
    }
    assert spins == {
        "four_bar": {"crank": (0, 0, -124.8), "coupler": (0, 0, 0), "rocker": (0, 0, -124.8)},
        "planar_slider_crank_gravity": {"crank": (0, 0, 30)},
        "spatial_slider_crank_gravity": {"crank": (0, 30, 0)},
        "rigid_slider_crank": {"crank": (6, 0, 0)},
    }
    for name, rate in (("four_bar", -124.8), ("five_bar", -124.8), ("spatial_slider_crank_driven", 124.8)):
        [driver] = SCENES[name]().driver
        assert driver.joint == "A" and tuple(driver.polynomial) == (0.0, rate)
    assert {b.angular_velocity for b in SCENES["four_bar_chain"]().body} == {(0, 0, -1), None}
    assert SCENES["heavy_top"]().body[0].angular_velocity == (0.0, 150.0, -4.61538)
    for body in SCENES["flyball_governor"]().body:
        assert body.angular_velocity == (0, 0, 2 * math.pi)
        assert np.allclose(body.velocity, np.cross(body.angular_velocity, body.position), atol=1e-15)


def test_loads():
    [moment] = SCENES["planar_slider_crank"]().load
    assert moment.body == "crank" and moment.moment == (0, 0, 100)
    [moment] = SCENES["spatial_slider_crank"]().load
    assert moment.body == "crank" and moment.moment == (0, 100, 0)
    springs = SCENES["flyball_governor"]().load
    assert [(s.bodies, s.stiffness, s.damping, s.natural_length) for s in springs] == [
        (("right", "slider"), 8e5, 4e4, 0.5),
        (("left", "slider"), 8e5, 4e4, 0.5),
    ]
    across = 0.05 + 0.5 * math.cos(math.radians(30))
    ends = [[(s * across, 0.0, 0.75), (s * 0.05, 0.0, 0.5)] for s in (1, -1)]
    assert np.allclose([s.points for s in springs], ends, rtol=0, atol=1e-15)


def test_andrews_mechanism_has_the_published_sizes():
    """Lengths of the links between their joints, distances of the centres of mass, and the spring's end."""
    scene = SCENES["andrews_squeezer"]()
    at = {joint.name: np.array(joint.anchor_pair[0]) for joint in scene.joint}
    lengths = {
        ("O", "F"): 0.007,
        ("F", "E3"): 0.028,
        ("B", "E3"): 0.035,
        ("A5", "G"): 0.04,
        ("A7", "H"): 0.04,
        ("G", "E4"): 0.02,
        ("H", "E6"): 0.02,
    }
    for (first, second), length in lengths.items():
        assert np.linalg.norm(at[first] - at[second]) == pytest.approx(length, abs=1e-15), (first, second)
    for name, place in {"O": (0, 0), "A5": (-0.06934, -0.00227), "B": (-0.03635, 0.03273)}.items():
        assert at[name].tolist() == [*place, 0.0]
    assert at["A7"].tolist() == at["A5"].tolist() and at["E4"].tolist() == at["E6"].tolist()
    centres = {"K1": ("O", 0.00092), "K2": ("F", 0.0115), "K4": ("E4", 0.01421), "K6": ("E6", 0.01421)}
    centres |= {"K3": ("B", math.hypot(0.01874, 0.01043)), "K5": ("A5", math.hypot(0.02308, 0.00916))}
    centres["K7"] = ("A7", math.hypot(0.01228, 0.00449))
    bodies = {body.name: body for body in scene.body}
    for name, (joint, distance) in centres.items():
        gap = np.linalg.norm(np.array(bodies[name].position) - at[joint])
        assert gap == pytest.approx(distance, abs=1e-15), name
    assert [b.mass for b in scene.body] == [0.04325, 0.00365, 0.02373, 0.00706, 0.0705, 0.00706, 0.05498]
    about = [2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5]
    assert [b.inertia[2] for b in scene.body] == about
    assert all(b.inertia[0] == b.inertia[1] == b.inertia[2] / 2 for b in scene.body)
    motor, spring = scene.load
    assert motor.body == "K1" and motor.moment == (0, 0, 0.033)
    assert (spring.stiffness, spring.natural_length, spring.damping) == (4530.0, 0.07785, 0.0)
    assert spring.points[1] == (0.014, 0.072, 0.0)
    reach = np.linalg.norm(np.array(spring.points[0]) - at["B"])
    assert reach == pytest.approx(math.hypot(0.018, 0.02), abs=1e-15)
    assert scene.duration == 0.03 and scene.gravity == NONE


def test_places_in_the_links_of_andrews_mechanism():
    """Centres of mass, the end of the spring and further joints in the frames of links."""
    scene = SCENES["andrews_squeezer"]()
    at = {joint.name: np.array(joint.anchor_pair[0]) for joint in scene.joint}
    bodies = {body.name: body for body in scene.body}
    spring = scene.load[1]
    for name, joint, place, along, across in (
        ("K1", "O", bodies["K1"].position, 0.00092, 0.0),
        ("K1", "O", at["F"], 0.007, 0.0),
        ("K2", "F", bodies["K2"].position, -0.0115, 0.0),
        ("K2", "F", at["E3"], -0.028, 0.0),
        ("K3", "B", bodies["K3"].position, 0.01043, -0.01874),
        ("K3", "B", spring.points[0], 0.02, -0.018),
        ("K4", "G", bodies["K4"].position, 0.0, 0.01421 - 0.02),
        ("K5", "A5", bodies["K5"].position, 0.02308, 0.00916),
        ("K5", "A5", at["G"], 0.04, 0.0),
        ("K6", "H", bodies["K6"].position, 0.02 - 0.01421, 0.0),
        ("K7", "A7", bodies["K7"].position, 0.00449, -0.01228),
        ("K7", "A7", at["H"], 0.0, -0.04),
    ):
        w, _, _, z = bodies[name].orientation
        cosine, sine = w * w - z * z, 2 * w * z
        x, y, _ = np.array(place) - at[joint]
        local = (cosine * x + sine * y, cosine * y - sine * x)
        assert local == pytest.approx((along, across), abs=1e-15), (name, joint)


def test_angles_of_andrews_mechanism():
    """Angles of the published start: β, β + Θ, γ, Φ + δ, δ, Ω + ε, ε."""
    turned = [2 * math.atan2(b.orientation[3], b.orientation[0]) for b in SCENES["andrews_squeezer"]().body]
    beta, gamma, phi, delta, epsilon = (
        -0.0617138900142764,
        0.45527981916307,
        0.222668390165885,
        0.48736498,
        1.23054745,
    )
    wanted = [beta, beta, gamma, phi + delta, delta, epsilon - phi, epsilon]
    assert turned == pytest.approx(wanted, abs=1e-8)


def test_bennett_linkage_has_opposite_links_of_equal_length_and_twist():
    """Links of 0.3 m and 30°, 0.5 m and asin(0.5 sin 30° / 0.3), in turn; rods of 1 kg per metre between."""
    scene = SCENES["bennett"]()
    points = [np.array(joint.anchor_pair[0]) for joint in scene.joint]
    axes = [np.array(joint.axis) for joint in scene.joint]
    sizes = [
        (np.linalg.norm(points[k] - points[k - 1]), abs(axes[k] @ axes[k - 1])) for k in range(len(points))
    ]
    twists = [math.cos(math.radians(30)), math.sqrt(1 - (0.25 / 0.3) ** 2)]
    wanted = [(0.3, twists[0]), (0.5, twists[1])] * 2
    assert np.allclose(sizes, wanted, rtol=0, atol=1e-14), sizes
    mass, first, inertia = parts_of(scene)
    rods = [rod(length, points[k - 1], points[k]) for k, length in ((1, 0.5), (2, 0.3), (3, 0.5))]
    second = sum(part[2] for part in rods)
    assert mass == pytest.approx(1.3) and np.allclose(first, sum(part[1] for part in rods), atol=1e-15)
    assert np.allclose(inertia, np.trace(second) * np.eye(3) - second, atol=1e-14)
    assert scene.gravity == DOWN_Z and scene.duration == 1.0 and points[3].tolist() == [0, 0, 0]
    middle = np.array(scene.body[0].position)
    assert np.allclose(middle, (points[0] + points[1]) / 2, atol=1e-15)
    assert points[0] == pytest.approx([0.3 * math.cos(1.0), 0.3 * math.sin(1.0), 0.0], abs=1e-15)


def test_two_rhombi_of_one_rocker():
    """The frame of the second rhombus is turned by 0.2 rad; all bars are 0.5 m long."""
    scene = two_rhombi(0.2)
    at = {joint.name: np.array(joint.anchor_pair[0]) for joint in scene.joint}
    for first, second in (("D", "G"), ("C", "F"), ("G", "F"), ("D", "E")):
        assert np.linalg.norm(at[first] - at[second]) == pytest.approx(0.5, abs=1e-15), (first, second)
    assert at["C"].tolist() == at["E"].tolist()
    assert at["G"] - at["D"] == pytest.approx([0.5 * math.cos(0.2), 0.5 * math.sin(0.2), 0.0])
    bars = [rod(0.5, at["E"], at["F"]), rod(0.5, at["G"], at["F"])]
    second = sum(part[2] for part in (*rhombus(0.3), *bars))
    assert np.allclose(parts_of(scene)[2], np.trace(second) * np.eye(3) - second, atol=1e-14)
    assert scene.gravity == DOWN_Y and scene.duration == 1.0


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("four_bar_chain[0]", "unknown scene 'four_bar_chain[0]'"),
        ("sarrus[3]", "unknown scene 'sarrus[3]'"),
        ("robot.urdf", "robot.urdf: is no scene file; `mbref import robot.urdf` makes one"),
        ("four_bar.toml", "four_bar.toml: no such file; without .toml 'four_bar' is a built-in scene"),
        ("nothing.toml", "nothing.toml: no such file"),
        ("fourbar", "did you mean 'four_bar'"),
    ],
)
def test_names_that_are_no_scene(name, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError) as caught:
        find_scene(name)
    assert says in str(caught.value), caught.value
