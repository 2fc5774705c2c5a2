"""Built-in scenes / types, bodies, axes and anchors of all joints, as their figures show them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mbref.scene import Scene
from mbref.scenes import SCENES, find_scene
from mbref.scenes.four_bar import two_rhombi

AXES = {letter: row for letter, row in zip("xyz", np.eye(3).tolist(), strict=True)}
AXES |= {"-x": [-1.0, 0.0, 0.0], "down": [0.0, -2 / math.sqrt(5), 1 / math.sqrt(5)]}

FOUR_BAR = (
    "A revolute ground crank z, B universal crank coupler z y, C universal coupler rocker y z, "
    "D revolute ground rocker z"
)
PLANAR = (
    "A{0} revolute ground crank{0} z, B{0} revolute crank{0} rod{0} z, C{0} spherical rod{0} slider{0}, "
    "D{0} translational ground slider{0} x"
)
SPATIAL = (
    "A revolute ground crank y, B universal crank rod y z, C spherical rod slider, "
    "D translational ground slider y"
)
HAUG = (
    "A revolute ground crank x, B spherical crank rod, C universal slider rod x down, "
    "D translational ground slider x"
)
JOINTS = {
    "four_bar": FOUR_BAR,
    "four_bar_gravity": FOUR_BAR,
    "five_bar": f"{FOUR_BAR}, E revolute crank bar z, F revolute bar rocker z",
    "spatial_slider_crank": SPATIAL,
    "spatial_slider_crank_driven": SPATIAL,
    "planar_slider_crank": PLANAR.format(""),
    "planar_slider_crank_gravity": PLANAR.format(""),
    "slider_crank_chain": f"{PLANAR.format(1)}, {PLANAR.format(2)}, E1 fixed crank1 crank2",
    "four_bar_chain[1]": (
        "A0 revolute ground upright0 z, A1 revolute ground upright1 z, B1 universal upright0 bar1 z y, "
        "C1 universal bar1 upright1 y z"
    ),
    "point_pendulum": "pivot revolute ground mass z",
    "andrews_squeezer": (
        "O revolute ground K1 z, F revolute K1 K2 z, B revolute ground K3 z, A5 revolute ground K5 z, "
        "A7 revolute ground K7 z, G revolute K5 K4 z, H revolute K7 K6 z, E3 revolute K2 K3 z, "
        "E4 revolute K2 K4 z, E6 revolute K2 K6 z"
    ),
    "bricard": (
        "P0 revolute ground rod1 y, P1 revolute rod1 rod2 z, P2 revolute rod2 rod3 x, "
        "P3 revolute rod3 rod4 y, P4 revolute rod4 rod5 z, P5 revolute rod5 ground x"
    ),
    "flyball_governor": (
        "bearing revolute ground shaft z, slide translational shaft slider z, "
        "hinge_right revolute shaft right y, hinge_left revolute shaft left y"
    ),
    "rigid_slider_crank": HAUG,
    "rigid_slider_crank_middle": HAUG,
    "heavy_top": "tip spherical ground top",
    "sarrus": (
        "x0 revolute ground lower_x y, x1 revolute lower_x upper_x y, x2 revolute upper_x platform y, "
        "y0 revolute ground lower_y -x, y1 revolute lower_y upper_y -x, y2 revolute upper_y platform -x"
    ),
    "h_frame": "left revolute ground frame y, right revolute ground frame y, bolt fixed frame block",
    "bennett": (
        "R1 revolute ground link1, R2 revolute link1 link2, R3 revolute link2 link3, R4 revolute link3 ground"
    ),
}


def check_joints(scene: Scene, listed: str) -> None:
    """Check names, types, bodies and axes of a scene's joints."""
    assert len(scene.joint) == listed.count(",") + 1
    for joint, text in zip(scene.joint, listed.split(", "), strict=True):
        name, kind, first, second, *axes = text.split()
        assert (joint.name, joint.type, joint.bodies) == (name, kind, (first, second))
        found = np.array(joint.directions).reshape(-1, 3)
        assert np.allclose(np.linalg.norm(found, axis=1), 1.0, rtol=0, atol=1e-14), name
        if scene.name == "bennett":  # its axes are skew
            continue
        wanted = np.array([AXES[letter] for letter in axes]).reshape(-1, 3)
        assert found.shape == wanted.shape and np.allclose(found, wanted, rtol=0, atol=1e-14), name


@pytest.mark.parametrize("name", JOINTS)
def test_types_bodies_and_axes(name):
    check_joints(find_scene(name), JOINTS[name])


def test_joints_of_two_rhombi():
    more = "E revolute rocker coupler2 z, F revolute coupler2 rocker2 z, G revolute ground rocker2 z"
    check_joints(two_rhombi(0.2), f"{FOUR_BAR}, {more}")


def test_the_rods_axis_is_perpendicular_to_the_line_of_the_slider():
    """From the pin at 0.3 rad the rod goes 0.15 m - 0.1 m cos 0.3 along x and 0.1 m sin 0.3 along z."""
    along = 0.15 - 0.1 * math.cos(0.3), 0.1 * math.sin(0.3)
    rod = find_scene("spatial_slider_crank_gravity").joint_named("B").directions[1]
    size = math.hypot(*along)
    assert np.allclose(rod, (-along[1] / size, 0.0, along[0] / size), rtol=0, atol=1e-14)


def crank_end(angle: float, z: float) -> list[tuple[float, float, float]]:
    """Return the four anchors of a planar slider-crank of 0.304 m and 0.4048 m."""
    x, y = 0.304 * math.cos(angle), 0.304 * math.sin(angle)
    end = x + math.sqrt(0.4048**2 - y**2)
    return [(0, 0, z), (x, y, z), (end, 0, z), (end, 0, z)]


RISE = 0.25 * math.sqrt(3)  # of a bar of 0.5 m at 60°
FEET = [(0.2, 0.0), (0.45, RISE), (0.2, 2 * RISE)]
THIRD = 2 * math.pi / 3
PLACES = {
    "point_pendulum": [(0, 0, 0)],
    "heavy_top": [(0, 0, 0)],
    "sarrus": [*((r, 0, z) for r, z in FEET), *((0, r, z) for r, z in FEET)],
    "slider_crank_chain": [*crank_end(0.3 + THIRD, 0.1), *crank_end(0.3 + 2 * THIRD, 0.2), (0, 0, 0.1)],
    "four_bar_chain": [
        *((i, 0, 0) for i in range(3)),
        *((0, 1, 0), (1, 1, 0), (1, 1, 0), (2, 1, 0)),
    ],
    "planar_slider_crank_gravity": crank_end(0.3, 0.0),
    "four_bar_quarter": [
        (0, 0, 0),
        (math.sqrt(0.125), math.sqrt(0.125), 0),
        (0.5 + math.sqrt(0.125), math.sqrt(0.125), 0),
        (0.5, 0, 0),
    ],
}


@pytest.mark.parametrize("name", PLACES)
def test_places_of_joints(name):
    found = [joint.anchor_pair[0] for joint in SCENES[name]().joint]
    assert np.allclose(found, PLACES[name], rtol=0, atol=1e-14)


def test_speeds_of_the_crankshaft():
    """Both cranks turn at 30 rad/s about z; no other body has given velocities."""
    spins = {b.name: b.angular_velocity for b in SCENES["slider_crank_chain"]().body if b.angular_velocity}
    assert spins == {"crank1": (0, 0, 30), "crank2": (0, 0, 30)}
    uprights = {b.name: b.angular_velocity for b in find_scene("four_bar_chain[1]").body}
    assert uprights == {"upright0": (0, 0, -1), "upright1": (0, 0, -1), "bar1": None}
