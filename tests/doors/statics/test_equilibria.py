"""Equilibria of mechanisms that are singular, marginal, stiff, or wound by many turns, by closed forms."""

import json

import numpy as np
import pytest
from scipy.optimize import minimize

from crosscheck.judge.small_motions.equilibria import steady_poses
from mbref import Scene, SceneError, equilibria
from mbref.cli.commands import main
from tests.helpers import parts
from tests.helpers.statics import DOWN, ORIGIN, G, ball_linkage, hinge, parallelogram, pendulum, rod, slide

MASS, INERTIA, ARM = 2.0, 0.3, 0.7
ABOUT_HINGE = INERTIA + MASS * ARM**2
TORQUE = MASS * G * ARM
CLOSE = 1e-9  # m, rad, or relative: the search ends at forces of about 1e-12 N


def spring(stiffness: float, **fields) -> dict:
    return {"type": "torsion_spring", "joint": "A", "stiffness": stiffness, **fields}


def with_slide(stiffness: float, damping: float, mass: float) -> Scene:
    """A pendulum near its upright pose, and apart from it a small mass on a stiff or damped slide."""
    beside = pendulum((ARM * np.sin(0.2), ARM * np.cos(0.2), 0.0))
    load = {"type": "slide_spring", "joint": "T", "stiffness": stiffness, "damping": damping}
    return beside.with_(
        body=(*beside.body, rod("block", (1.0, 0.0, 0.0), mass, 0.01)),
        joint=(*beside.joint, slide("T", "block", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
        load=(load,),
    )


def test_flat_parallelogram_is_an_equilibrium_at_a_singular_position_and_has_no_modes(tmp_path, capsys):
    """Gravity acts along all links, so they rest: `equilibrium` reports it, `modes` refuses it, and the judge
    leaves it out. The judge finds a parallelogram that hangs, from a start 13° off."""
    flat = parallelogram(sine=0.0, cosine=1.0).with_(gravity=(G, 0.0, 0.0))
    found = equilibria(flat, starts=2)
    assert found[0].stability == "singular" and len(found[0].eigenvalues) == 0
    assert not steady_poses(flat, starts=1)
    hanging = steady_poses(parallelogram(sine=-0.96, cosine=0.28), starts=1)
    assert [each.stability for each in hanging] == ["stable"]
    path = str(tmp_path / "flat.toml")
    flat.save(path)
    assert main(["equilibrium", path, "--starts", "1"]) == 0
    assert "equilibrium 1: at a singular position" in capsys.readouterr().out
    assert main(["modes", path, "--starts", "1"]) == 2
    assert "at a singular position" in capsys.readouterr().err


@pytest.mark.parametrize(("tilt", "found"), [(1e-6, []), (0.0, ["indifferent"])])  # rad
def test_block_on_a_level_slide_rests_everywhere_and_on_a_tilted_one_nowhere(tilt, found):
    """Along the slide the acceleration is G sin(tilt), a millionth of the weight's, and nothing holds it."""
    parts = {"body": [rod("block", (0.5, 0.0, 0.0))], "joint": [slide("S", "block", ORIGIN, (1.0, 0.0, 0.0))]}
    block = Scene(name="block", gravity=(G * np.sin(tilt), -G * np.cos(tilt), 0.0), **parts)
    assert [each.stability for each in equilibria(block, starts=2)] == found


@pytest.mark.parametrize("natural", [0.0, np.pi])
def test_inverted_pendulum_that_its_spring_just_holds_is_one_indifferent_equilibrium(natural):
    """k = m g l leaves no stiffness at the upright pose, where the search begins, or half a turn off."""
    start = (0.0, ARM * np.cos(natural), 0.0)
    found = equilibria(pendulum(start, load=[spring(TORQUE, natural_angle=natural)]), starts=8)
    assert [each.stability for each in found] == ["indifferent"]
    assert not found[0].eigenvalues.any()


@pytest.mark.parametrize("share", [-1e-6, 1e-6])
def test_inverted_pendulum_is_stable_or_unstable_by_a_millionth_of_its_critical_stiffness(share):
    """Eigenvalues are s² = -(k - m g l) / I with the spring's stiffness k = m g l (1 + share)."""
    each = equilibria(pendulum((0.0, ARM, 0.0), load=[spring(TORQUE * (1 + share))]), starts=1)[0]
    assert each.stability == ("stable" if share > 0 else "unstable")
    # k - m g l is a difference of a millionth: rounding of 1e-12 is relative to it 1e-6, with a margin of 100
    assert np.allclose(each.eigenvalues**2, -share * TORQUE / ABOUT_HINGE, rtol=1e-4, atol=0)


def test_slow_fall_of_a_pendulum_is_found_beside_a_damper_ten_million_times_faster():
    """The pendulum falls with √(m g l / I) = 3.3 1/s, and the block of 0.1 g has c / m = 1e7 1/s. The judge's
    error is at most its bound, below 1e-9 1/s, and the rounding of the closed form, 4e-16 of it."""
    fast = with_slide(100.0, 1000.0, 1e-4)
    rate = np.sqrt(TORQUE / ABOUT_HINGE)
    [upright] = equilibria(fast, starts=1)
    assert upright.stability == "unstable"
    assert np.abs(upright.eigenvalues - rate).min() < 1e-8 * rate  # 15 roundings of 1e7 1/s
    assert np.abs(upright.eigenvalues.real).max() == pytest.approx(1e7, rel=1e-6)
    judged = {each.stability: each for each in steady_poses(fast, starts=4)}
    errors = np.abs(judged["unstable"].eigenvalues - rate)
    bound = judged["unstable"].bounds[errors.argmin()]
    assert set(judged) == {"stable", "unstable"} and errors.min() <= bound + 4e-16 * rate and bound < 1e-9


@pytest.mark.parametrize("stiffness", [1e2, 1e5, 1e9])
def test_both_equilibria_of_a_pendulum_are_found_beside_springs_of_any_stiffness(stiffness):
    """The pendulum rests at heights of ± l, both with √(m g l / I) as the least eigenvalue."""
    found = equilibria(with_slide(stiffness, 0.0, 0.01), starts=4)
    assert sorted(each.stability for each in found) == ["stable", "unstable"]
    heights = sorted(each.scene.body[0].position[1] for each in found)
    assert np.allclose(heights, [-ARM, ARM], rtol=0, atol=1e-10)  # m
    slow = [np.sort(np.abs(each.eigenvalues))[:2] for each in found]
    assert np.allclose(slow, np.sqrt(TORQUE / ABOUT_HINGE), rtol=CLOSE, atol=0)


def centres(lengths: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return centres (k, 3) of rods that hang on each other from the origin, at these angles."""
    ways = (lengths * np.array([np.sin(angles), -np.cos(angles), 0 * angles])).T
    return np.cumsum(ways, axis=0) - ways / 2


def ends(places: np.ndarray) -> list[np.ndarray]:
    """Return the origin and the further ends (3,) of the rods with these centres."""
    found = [np.zeros(3)]
    for place in places:
        found.append(2 * place - found[-1])
    return found


def rods(lengths: np.ndarray, masses: np.ndarray, angles: np.ndarray, load: list) -> Scene:
    """Return the chain of these rods, b0 to bk on hinges J0 to Jk."""
    places = centres(lengths, angles)
    anchors = ends(places)[:-1]
    names = ["ground", *(f"b{k}" for k in range(len(masses)))]
    rods = [rod(*each) for each in zip(names[1:], places, masses, strict=True)]
    hinges = [hinge(f"J{k}", names[k : k + 2], anchor) for k, anchor in enumerate(anchors)]
    return Scene(name="chain", gravity=DOWN, body=rods, joint=hinges, load=load)


@pytest.mark.parametrize("is_on_slide", [False, True])
def test_chain_that_a_stiff_spring_holds_is_found_in_both_stable_poses(is_on_slide):
    """Three rods hang from the origin, or from a block there on a slide with a spring of 1e8 N/m; another
    spring holds the middle of the second rod. The potential energy has two least values: scipy finds one from
    the pose at the start, the other from the hanging pose. Both are stable poses, to 10 mm."""
    stiffness = 1e7
    lengths, masses, start = np.array([1.0, 1.0, 0.5]), np.array([2.0, 2.0, 1.0]), np.array([0.5, 1.0, 1.5])
    held, fixed = centres(lengths, start)[1], np.array([0.5, -1.2, 0.0])
    natural = float(np.linalg.norm(held - fixed))

    def energy(angles):
        longer = np.linalg.norm(centres(lengths, angles)[1] - fixed) - natural
        return masses @ centres(lengths, angles)[:, 1] * G + stiffness * longer**2 / 2

    holder = parts.spring("ground", fixed, "b1", held, stiffness, natural)
    scene = rods(lengths, masses, start, [holder])
    if is_on_slide:
        carried = (slide("S", "block", ORIGIN, (0.0, 1.0, 0.0)), hinge("J0", ("block", "b0")))
        scene = scene.with_(
            body=(*scene.body, rod("block", ORIGIN, 1.0)),
            joint=(*carried, *scene.joint[1:]),
            load=(*scene.load, {"type": "slide_spring", "joint": "S", "stiffness": 1e8}),
        )
    stable = [e.scene.body[2].position for e in equilibria(scene, starts=2) if e.stability == "stable"]
    for guess in (start, np.zeros(3)):
        least = minimize(energy, guess, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-13}).x
        assert min(np.abs(place - centres(lengths, least)[2]).max() for place in stable) < 0.01


def test_modes_without_the_driver_of_a_pendulum_are_its_free_vibration(tmp_path, capsys):
    """The frequency is √(m g l / J) / 2π with the moment of inertia J about the hinge."""
    path = tmp_path / "driven.toml"
    pendulum().with_(driver=[{"joint": "A", "polynomial": [0.0, 1.0]}]).save(path)
    assert main(["modes", str(path), "--undriven", "A", "--json"]) == 0
    [frequency] = json.loads(capsys.readouterr().out)["frequencies"]
    assert frequency == pytest.approx(np.sqrt(TORQUE / ABOUT_HINGE) / (2 * np.pi), rel=1e-9)


def test_modes_without_the_driver_of_a_joint_that_has_none_are_refused(capsys):
    """`modes --undriven JOINT` takes a driver away; this four-bar has none."""
    assert main(["modes", "four_bar_gravity", "--undriven", "B"]) == 2
    assert "joint 'B' has no driver; driven joints: none" in capsys.readouterr().err


def test_tackle_in_balance_is_one_indifferent_equilibrium_with_eigenvalues_zero():
    """Masses of 2 kg and 1 kg that move by 1 and -2: their weights balance at every height."""
    left, right = (0.0, -1.0, 0.0), (0.5, -0.3, 0.0)
    bodies = [rod("load", left, 2.0), rod("weight", right, 1.0)]
    joints = [slide("L", "load", left, parts.Y), slide("W", "weight", right, parts.Y)]
    rope = {"name": "rope", "joints": ["L", "W"], "ratio": -2.0}
    scene = Scene(name="tackle", gravity=DOWN, body=bodies, joint=joints, coupling=[rope])
    [each] = equilibria(scene, starts=6)
    assert each.stability == "indifferent" and not each.eigenvalues.any() and not len(each.frequencies)
    assert [each.stability for each in steady_poses(scene, starts=3)] == ["indifferent"]


@pytest.mark.parametrize(
    ("share", "natural", "starts", "count"),
    [
        (0.15, 0.4, 2, 5),
        (0.999, np.pi / 2, 1, 3),
        pytest.param(0.07, 2 * np.pi * 3.1, 2, 9, marks=pytest.mark.slow),
    ],
)
def test_all_windings_of_a_soft_spring_have_their_equilibria(share, natural, starts, count):
    """At equilibria k (φ₀ - φ) = m g l cos φ, with k = share · m g l and φ₀ = natural. The difference of both
    sides changes its sign ``count`` times in 20001 angles, to their step."""
    stiffness = share * TORQUE
    angles = natural + np.linspace(-1.01, 1.01, 20001) / share
    off = stiffness * (natural - angles) - TORQUE * np.cos(angles)
    twists = (natural - angles)[np.flatnonzero(off[:-1] * off[1:] < 0)]
    found = equilibria(pendulum(load=[spring(stiffness, natural_angle=natural)]), starts=starts)
    remaining = np.sort([each.scene.load[0].natural_angle for each in found])
    assert len(twists) == count
    assert remaining == pytest.approx(np.sort(twists), abs=1.01 / share * 1e-4)


@pytest.mark.parametrize("angle", [0.0, 1.0])
def test_angle_of_a_wheel_that_no_force_turns_makes_one_indifferent_equilibrium(angle):
    """A wheel at the end of a hanging rod, on a hinge through its centre of mass, starts at an angle."""
    turned = {"orientation": [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]}
    bodies = [rod("rod", (0.0, -ARM, 0.0)), rod("wheel", (0.0, -2 * ARM, 0.0), 1.0) | turned]
    joints = [hinge("A", ("ground", "rod")), hinge("W", ("rod", "wheel"), (0.0, -2 * ARM, 0.0))]
    scene = Scene(name="wheel", gravity=DOWN, body=bodies, joint=joints)
    found = equilibria(scene, starts=5)
    assert [each.stability for each in found if each.scene.body[0].position[1] < 0] == ["indifferent"]
    with pytest.raises(SceneError, match=r"body\[wheel\]\.inertia: no inertia resists a motion"):
        equilibria(scene.with_("body[wheel].inertia", [0.0] * 3))


@pytest.mark.parametrize("gravity", [DOWN, (3.0, -5.0, -7.0)])
def test_linkage_whose_coupler_spins_idly_has_the_equilibria_of_one_whose_universal_joint_holds_it(gravity):
    """No force turns the free coupler about its axis, so that its centre rests at the places of the held one.
    Its spin adds two eigenvalues, which are zero within their bounds: poses that are stable with the
    universal joint become indifferent."""
    scenes = (ball_linkage((end, "spherical")) for end in ("spherical", "universal"))
    free, held = (equilibria(scene.with_(gravity=gravity), 4) for scene in scenes)
    assert {each.stability for each in held} == {"stable", "unstable"}
    expected = sorted({"stable": "indifferent", "unstable": "unstable"}[each.stability] for each in held)
    assert sorted(each.stability for each in free) == expected
    places = [np.array(sorted(each.scene.body[1].position for each in found)) for found in (free, held)]
    assert np.allclose(*places, rtol=0.0, atol=CLOSE)
    assert all((np.abs(each.eigenvalues) <= each.bounds).sum() == 2 for each in free)


def test_rod_on_a_ball_joint_hangs_and_stands_and_spins_idly():
    """A thin rod of length l has in each of two planes the rates ± √(3 g / 2 l), imaginary where it hangs and
    real where it stands, and zero twice by its spin about itself."""
    end = (0.9, -0.2, 0.1)
    joints = [parts.joint("B", "spherical", "ground", "rod")]
    scene = Scene(name="rod", gravity=DOWN, body=[parts.rod("rod", ORIGIN, end)], joint=joints)
    hanging, upright = equilibria(scene, starts=4)
    assert (hanging.stability, upright.stability) == ("indifferent", "unstable")
    length = np.linalg.norm(end)
    rate = np.sqrt(1.5 * G / length)
    for each, height, unit in ((hanging, -length / 2, 1j), (upright, length / 2, 1.0)):
        assert np.allclose(each.scene.body[0].position, (0.0, height, 0.0), rtol=0.0, atol=CLOSE)
        rates = sorted(each.eigenvalues / unit, key=np.real)
        assert np.allclose(rates, [-rate, -rate, 0.0, 0.0, rate, rate], rtol=0.0, atol=CLOSE)


def test_bounds_of_eigenvalues_in_json_are_at_least_their_errors(tmp_path, capsys):
    """Eigenvalues of a hanging pendulum are ± i √(m g l / I)."""
    path = str(tmp_path / "pendulum.toml")
    pendulum((0.0, -ARM, 0.0)).save(path)
    assert main(["modes", path, "--starts", "1", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    rate = np.sqrt(TORQUE / ABOUT_HINGE)
    errors = np.abs(np.array([imaginary for _, imaginary in shown["eigenvalues"]]) - [rate, -rate])
    assert (errors <= shown["bounds"]).all() and max(shown["bounds"]) < 1e-9 * rate
