"""Built-in scenes / axes of their joints, anchors, bodies and speeds, worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mbref import rotations
from mbref.scene import Scene
from mbref.scenes import find_scene

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ROD = np.cross(np.array([0.15, math.sqrt(0.4**2 - 0.05**2), 0.0]) - [0.1, 0.0, 0.0], Y)  # spatial, along z
HAUG = np.cross([0.2, -0.1, -0.2], X)  # along the rod of rigid_slider_crank, across the slider's axis
FOUR = [(Z,), (Z, Y), (Y, Z), (Z,)]
PLANAR = [(Z,), (Z,), (), (X,)]
AXES = {
    "four_bar": FOUR,
    "four_bar_gravity": FOUR,
    "five_bar": [*FOUR, (Z,), (Z,)],
    "spatial_slider_crank": [(Y,), (Y, tuple(ROD / np.linalg.norm(ROD))), (), (Y,)],
    "planar_slider_crank": PLANAR,
    "planar_slider_crank_gravity": PLANAR,
    "slider_crank_chain[3]": [*PLANAR * 3, (), ()],
    "four_bar_chain": [(Z,)] * 3 + [(Z, Y), (Y, Z)] * 2,
    "point_pendulum": [(Z,)],
    "andrews_squeezer": [(Z,)] * 10,
    "bricard": [(Y,), (Z,), (X,)] * 2,
    "flyball_governor": [(Z,), (Z,), (Y,), (Y,)],
    "rigid_slider_crank": [(X,), (), (X, tuple(HAUG / np.linalg.norm(HAUG))), (X,)],
    "heavy_top": [()],
    "sarrus": [(Y,)] * 3 + [((-1.0, 0.0, 0.0),)] * 3,
    "h_frame": [(Y,), (Y,), ()],
}


def pin(r: float, theta: float, z: float = 0.0) -> tuple[float, float, float]:
    return r * math.cos(theta), r * math.sin(theta), z


def planar(theta: float, z: float) -> list[tuple[float, float, float]]:
    y = 0.304 * math.sin(theta)
    end = (0.304 * math.cos(theta) + math.sqrt(0.4048**2 - y * y), 0.0, z)
    return [(0.0, 0.0, z), pin(0.304, theta, z), end, end]


RISE = 0.5 * math.sqrt(0.75)
FEET = [(0.2, 0.0), (0.45, RISE), (0.2, 2 * RISE)]
TIP = (0.15, math.sqrt(0.4**2 - (0.1 * math.cos(0.3) - 0.15) ** 2 - (0.1 * math.sin(0.3)) ** 2), 0.0)
ANCHORS = {
    "four_bar_gravity": [(0, 0, 0), pin(0.5, 0.3), np.add(pin(0.5, 0.3), (0.5, 0, 0)), (0.5, 0, 0)],
    "planar_slider_crank_gravity": planar(0.3, 0.0),
    "planar_slider_crank_equal": [(0, 0, 0), (0.308, 0, 0), (0.616, 0, 0), (0.616, 0, 0)],
    "slider_crank_chain[3]": [
        *(p for i in (1, 2, 3) for p in planar(0.3 + 2 * math.pi / 3 * i, 0.1 * i)),
        (0, 0, 0.1),
        (0, 0, 0.2),
    ],
    "spatial_slider_crank_gravity": [(0, 0, 0), (0.1 * math.cos(0.3), 0, -0.1 * math.sin(0.3)), TIP, TIP],
    "four_bar_chain": [
        *((i, 0, 0) for i in range(3)),
        *(p for i in (0, 1) for p in ((i, 1, 0), (i + 1, 1, 0))),
    ],
    "sarrus": [*((r, 0, z) for r, z in FEET), *((0, r, z) for r, z in FEET)],
    "heavy_top": [(0, 0, 0)],
    "point_pendulum": [(0, 0, 0)],
    "rigid_slider_crank_middle": [(0, 0.1, 0.12), (0, 0.1, 0.2), (0.2, 0, 0), (0.2, 0, 0)],
}
BODIES = {  # names of the pairs of the joints, and of all bodies
    "four_bar": (
        [("ground", "crank"), ("crank", "coupler"), ("coupler", "rocker"), ("ground", "rocker")],
        ["crank", "coupler", "rocker"],
    ),
    "five_bar_gravity": (
        [
            *[("ground", "crank"), ("crank", "coupler"), ("coupler", "rocker"), ("ground", "rocker")],
            *[("crank", "bar"), ("bar", "rocker")],
        ],
        ["crank", "coupler", "rocker", "bar"],
    ),
    "four_bar_chain": (
        [
            *(("ground", f"upright{i}") for i in range(3)),
            *[("upright0", "bar1"), ("bar1", "upright1"), ("upright1", "bar2"), ("bar2", "upright2")],
        ],
        ["upright0", "upright1", "upright2", "bar1", "bar2"],
    ),
    "slider_crank_chain": (
        [
            *(
                pair
                for i in "12"
                for pair in (
                    *[("ground", "crank" + i), ("crank" + i, "rod" + i)],
                    *[("rod" + i, "slider" + i), ("ground", "slider" + i)],
                )
            ),
            ("crank1", "crank2"),
        ],
        [name + i for i in "12" for name in ("crank", "rod", "slider")],
    ),
    "bricard": (
        [
            *[("ground", "rod1"), ("rod1", "rod2"), ("rod2", "rod3"), ("rod3", "rod4"), ("rod4", "rod5")],
            ("rod5", "ground"),
        ],
        [f"rod{n}" for n in range(1, 6)],
    ),
    "sarrus": (
        [
            (a, b)
            for s in "xy"
            for a, b in (
                ("ground", f"lower_{s}"),
                (f"lower_{s}", f"upper_{s}"),
                (f"upper_{s}", "platform"),
            )
        ],
        ["platform", "lower_x", "upper_x", "lower_y", "upper_y"],
    ),
    "flyball_governor": (
        [("ground", "shaft"), ("shaft", "slider"), ("shaft", "right"), ("shaft", "left")],
        ["shaft", "slider", "right", "left"],
    ),
    "rigid_slider_crank": (
        [("ground", "crank"), ("crank", "rod"), ("slider", "rod"), ("ground", "slider")],
        ["crank", "rod", "slider"],
    ),
    "bennett": (
        [("ground", "link1"), ("link1", "link2"), ("link2", "link3"), ("link3", "ground")],
        ["link1", "link2", "link3"],
    ),
}


def axes_of(scene: Scene) -> list[tuple[tuple[float, ...], ...]]:
    return [
        tuple(joint.axes) if hasattr(joint, "axes") else (joint.axis,) if hasattr(joint, "axis") else ()
        for joint in scene.joint
    ]


@pytest.mark.parametrize("name", AXES)
def test_axes_of_joints(name):
    found = axes_of(find_scene(name))
    assert [len(axes) for axes in found] == [len(axes) for axes in AXES[name]]
    for axes, expected in zip(found, AXES[name], strict=True):
        for axis, wanted in zip(axes, expected, strict=True):
            assert np.allclose(axis, wanted, rtol=0, atol=1e-15), (axes, expected)


@pytest.mark.parametrize("name", ANCHORS)
def test_more_points_of_joints(name):
    found = [joint.anchor_pair[0] for joint in find_scene(name).joint]
    assert np.allclose(found, np.array(ANCHORS[name], float), rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", BODIES)
def test_bodies_and_pairs_of_joints(name):
    scene, (pairs, names) = find_scene(name), BODIES[name]
    assert [joint.bodies for joint in scene.joint] == pairs and [body.name for body in scene.body] == names
    assert len({joint.name for joint in scene.joint}) == len(pairs)


@pytest.mark.parametrize(
    ("name", "spins"),
    [
        ("four_bar_gravity", {}),
        ("four_bar_chain", {f"upright{i}": (0, 0, -1) for i in range(3)}),
        ("slider_crank_chain", {"crank1": (0, 0, 30), "crank2": (0, 0, 30)}),
        ("planar_slider_crank_heavy", {}),
        (
            "five_bar",
            {name: (0, 0, -124.8 * (name in ("crank", "rocker"))) for name in BODIES["five_bar_gravity"][1]},
        ),
        ("rigid_slider_crank_middle", {"crank": (6, 0, 0)}),
        ("sarrus", {}),
    ],
)
def test_bodies_that_turn_at_first(name, spins):
    found = {b.name: b.angular_velocity for b in find_scene(name).body if b.angular_velocity is not None}
    assert found == spins


@pytest.mark.parametrize(
    ("name", "body", "axis", "angle"),
    [
        ("four_bar_gravity", "crank", Z, 0.3),
        ("four_bar_gravity", "coupler", Z, 0.0),
        ("five_bar_gravity", "bar", Z, 0.0),
        ("planar_slider_crank_gravity", "rod", Z, -math.asin(0.304 * math.sin(0.3) / 0.4048)),
        ("spatial_slider_crank_gravity", "crank", Y, 0.3),
        ("four_bar_chain", "upright2", Z, math.pi / 2),
        ("four_bar_chain", "bar1", Z, 0.0),
        ("flyball_governor", "right", Y, math.radians(30)),
        ("flyball_governor", "left", Y, math.radians(150)),
        ("sarrus", "lower_x", Y, math.radians(-60)),
        ("sarrus", "upper_x", Y, math.radians(-120)),
    ],
)
def test_orientations_of_bodies(name, body, axis, angle):
    [found] = [b.orientation for b in find_scene(name).body if b.name == body]
    expected = rotations.to_matrix(rotations.from_vector(angle * np.array(axis)))
    assert rotations.to_matrix(np.array(found)) == pytest.approx(expected, abs=1e-14)


def test_bars_of_sarrus_linkage_run_along_their_x_axes():
    bodies = {body.name: body for body in find_scene("sarrus").body}
    for name, along in {"lower_y": (0, 0.25, RISE), "upper_y": (0, -0.25, RISE)}.items():
        turned = rotations.to_matrix(np.array(bodies[name].orientation))[:, 0]
        assert turned == pytest.approx(np.array(along) / 0.5, abs=1e-15)
    assert bodies["lower_y"].inertia == (0.5 * 1e-4 / 2, *(0.5 * (3e-4 + 0.25) / 12,) * 2)
    assert bodies["platform"].mass == 1.0 and bodies["upper_x"].mass == 0.5
