"""Motions and entries of scenes as Python objects: bodies by name, scenes at samples, refused values."""

import numpy as np
import pytest

import crosscheck
import mbref
from mbref.scene import Body, Revolute
from tests.helpers.powered_mechanisms import powered_mechanism
from tests.helpers.short_motions import MOTIONS

GATE = (
    *("pendulum with torsion spring", "driven angle by a table", "planet with armatures", "driven gears"),
    *("pendulum with force over time", "arm with distance", "screw with armature"),
)
MAKERS = {**MOTIONS, **{f"powered {seed}": lambda seed=seed: powered_mechanism(seed) for seed in range(12)}}
CLOSE = 1e-8  # m, rad/s; two runs at rtol 1e-12, of which one starts with rounded poses


@pytest.fixture(scope="module")
def crank():
    return mbref.simulate("planar_slider_crank", times=[0.0, 0.05])


@pytest.mark.parametrize(
    "name", [n if n in GATE else pytest.param(n, marks=pytest.mark.slow) for n in MAKERS]
)
def test_scene_at_a_sample_continues_the_motion(name):
    """The scene at 0.4 of the duration, with drivers, loads over time, springs, couplings and offsets, ends
    as the whole run, to CLOSE (m, rad/s)."""
    scene = MAKERS[name]()
    times = scene.duration * np.array([0.4, 1.0])
    whole = mbref.simulate(scene, times=times, rtol=1e-12)
    rest = mbref.simulate(whole.scene_at(times[0]), times=[times[1] - times[0]], rtol=1e-12)
    assert np.abs(rest.position[0] - whole.position[1]).max() < CLOSE
    assert np.abs(rest.angular_velocity[0] - whole.angular_velocity[1]).max() < CLOSE


def test_scene_at_keeps_the_numbers_of_loads_after_one_is_switched_off():
    """From 0.02 s on load 0 is zero, and load 1 has at 0.05 s the power of the whole run."""
    motors = [
        {"type": "joint_torque", "joint": "A", "torque": 1.0, **more}
        for more in ({"factor": {"stop": 0.02}}, {})
    ]
    motion = mbref.simulate(mbref.find_scene("planar_slider_crank").with_(load=motors), times=[0.0, 0.05])
    later = mbref.simulate(motion.scene_at(0.05), times=[0.0])
    assert later.load_at(0).power[0] == 0.0
    assert later.load_at(1).power[0] == pytest.approx(motion.load_at(1).power[1], rel=CLOSE)


def test_scene_at_a_time_without_sample_is_refused_with_the_nearest_one(crank):
    with pytest.raises(mbref.InputError, match=r"no sample at 0\.03 s; the nearest one is at 0\.05 s"):
        crank.scene_at(0.03)


def test_motion_is_a_dictionary_of_its_bodies(crank):
    """IPython completes the names of bodies by ``_ipython_key_completions_``."""
    assert list(crank) == ["crank", "rod", "slider"] and len(crank) == 3
    assert "rod" in crank and "lid" not in crank and 0 not in crank
    assert crank._ipython_key_completions_() == list(crank)


def test_motion_and_its_parts_are_equal_to_themselves_only(crank):
    """A motion of equal numbers is another motion; so are two objects of one body."""
    again = mbref.Motion.of(crank.mechanism, crank)
    assert crank in (crank,) and crank != again and len({crank, again, crank}) == 2
    assert crank["rod"] != crank["rod"] and len({crank.joint("A"), crank["rod"]}) == 2


@pytest.mark.parametrize(
    ("kind", "fields", "says"),
    [
        (Body, {"name": "b", "position": (0, 0)}, "position: must be three numbers"),
        (
            Body,
            {"name": "b", "position": (0, 0, 0), "mass": "3 N"},
            "mass: must be a number, or one with a unit",
        ),
        (Revolute, {"name": "A", "bodies": ("a", "b"), "anchor": (0, 0, 0), "axi": (0, 0, 1)}, "mean 'axis'"),
        (mbref.Scene, {}, "body: is required"),
    ],
    ids=["two numbers for three", "newtons for kilograms", "misspelt field", "nothing given"],
)
def test_faulty_entry_made_in_python_is_refused_without_a_word_of_pydantic(kind, fields, says):
    """pydantic, which checks the fields, would add its own name and an address in the network."""
    with pytest.raises(mbref.SceneError, match=says) as caught:
        kind(**fields)
    assert "pydantic" not in str(caught.value) and "http" not in str(caught.value)


def test_entry_cannot_be_changed_and_its_error_names_the_remedy():
    """The remedy is ``with_``, which returns a changed copy."""
    scene = mbref.find_scene("four_bar")
    with pytest.raises(AttributeError, match=r"scene\.with_\(\.\.\.\) returns a changed copy"):
        scene.duration = 3.0
    with pytest.raises(AttributeError, match=r"Body\.mass cannot be set"):
        scene.body[0].mass = 3.0
    assert scene == mbref.find_scene("four_bar")


@pytest.mark.parametrize("package", [mbref, crosscheck])
def test_dir_of_a_package_has_its_public_names_alone(package):
    """The public names are in ``__all__``, and each of them exists."""
    assert set(dir(package)) - {"__version__"} == set(package.__all__)
    assert all(getattr(package, name) is not None for name in dir(package))
