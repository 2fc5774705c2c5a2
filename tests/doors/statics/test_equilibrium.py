"""Equilibria and vibrations, by mbref and by the judge, against closed forms of pendulums and springs."""

import numpy as np
import pytest

from crosscheck.engine import engine
from crosscheck.judge.small_motions.equilibria import steady_poses
from crosscheck.small_motions.compare import by_accelerations, error
from mbref import Scene, SceneError, equilibria, find_scene, motion_of_mode
from mbref.cli.commands import main
from tests.helpers.statics import ORIGIN, G, pendulum, slide

MASS, INERTIA, ARM = 2.0, 0.3, 0.7  # kg, kg m², m: of the pendulum
POSE = 1e-10  # m, rad, N: Newton's method ends at forces of about 1e-12 N


def damped_spring() -> Scene:
    """Return a body on a damped torsion spring, which is relaxed at 0.4 rad."""
    spring = {"type": "torsion_spring", "joint": "A", "stiffness": 40.0, "damping": 3.0, "natural_angle": 0.4}
    return pendulum(gravity=ORIGIN, load=[spring])


def test_a_damped_torsion_spring_has_the_roots_of_its_equation():
    """(J + m l²) s² + c s + k = 0 with c = 3 N m s/rad, k = 40 N m/rad; the damping ratio is -Re s / |s|."""
    rounding, [each] = 1e-10, equilibria(damped_spring(), starts=1)  # relative
    roots = np.roots([INERTIA + MASS * ARM**2, 3.0, 40.0])
    assert sorted(each.eigenvalues, key=np.imag) == pytest.approx(sorted(roots, key=np.imag), rel=rounding)
    assert each.damping_ratios[0] == pytest.approx(-roots[0].real / abs(roots[0]), rel=rounding)


def test_damping_is_exact_where_the_forces_of_stretched_springs_on_a_body_cancel():
    """m s² + c s + k₁ + k₂ = 0 of a slide between two springs along its guide, without weight."""
    at, guide = (0.7, 0.0, 0.0), slide("A", "rod", ORIGIN, (1.0, 0.0, 0.0))
    spring = {"type": "spring", "bodies": ["ground", "rod"], "natural_length": 0.3}
    left = spring | {"points": [ORIGIN, at], "stiffness": 10.0, "damping": 0.5}
    right = spring | {"points": [(1.1, 0.0, 0.0), at], "stiffness": 40.0}  # stretched by 0.1 m, left by 0.4 m
    [each] = equilibria(pendulum(gravity=ORIGIN, joint=[guide], load=[left, right]), starts=1)
    exact = np.roots([MASS, 0.5, 50.0])
    assert sorted(each.eigenvalues, key=np.imag) == pytest.approx(sorted(exact, key=np.imag), rel=1e-10)


@pytest.mark.parametrize("height", [1e-1, 1e-2, 1e-3, 1e-4])
def test_frequency_on_a_spring_far_shorter_than_the_mechanism_is_that_of_its_stiffness(height):
    """A slide of 2 kg, 1 m from its guide's anchor, is on a spring across the guide. The spring of 300 N/m is
    stretched to twice its natural length: half of its stiffness, 150 N/m, acts along the guide. The judge has
    the frequency to 1e-9, and from mbref's accelerations, at heights of 1 mm and more, to 1e-6."""
    spring = {"type": "spring", "bodies": ["ground", "rod"], "stiffness": 300.0, "natural_length": height / 2}
    across = {"points": [[0.7, height, 0.0], [0.7, 0.0, 0.0]]}
    guide = slide("A", "rod", (-0.3, 0.0, 0.0), (1.0, 0.0, 0.0))
    scene = pendulum(gravity=ORIGIN, joint=[guide], load=[spring | across])
    [each], [judged], exact = equilibria(scene, 1), steady_poses(scene, 1), np.sqrt(150.0 / MASS)
    off = abs(abs(each.eigenvalues[0]) - exact)
    assert off < 1e-4 * exact and off <= each.bounds[0] + 1e-12 * exact
    assert error(judged.eigenvalues, np.array([1j * exact, -1j * exact])) < 1e-9
    found = by_accelerations(engine("mbref"), judged).eigenvalues
    assert height < 1e-3 or error(found, judged.eigenvalues) < 1e-6


def test_scene_of_an_equilibrium_counts_angles_from_its_pose_and_is_its_own_equilibrium():
    """The arm of 0.7 m rests at 0.4 rad, its spring relaxed (POSE), with the natural angle 0."""
    [each] = equilibria(damped_spring(), starts=1)
    place = ARM * np.array([np.cos(0.4), np.sin(0.4), 0.0])
    assert np.allclose(each.scene.body[0].position, place, rtol=0, atol=POSE)
    assert each.scene.load[0].natural_angle == pytest.approx(0.0, abs=POSE)
    [again] = equilibria(each.scene, starts=1)
    assert np.allclose(again.scene.body[0].position, place, rtol=0, atol=POSE)


@pytest.mark.parametrize(
    ("change", "says", "judged"),
    [
        ({"polynomial": [0.0, 0.0, 1.0]}, r"driver\[A\]: moves", "small motions need drivers"),
        ({"sine": {"amplitude": 1.0, "frequency": 2.0}}, "needed are drivers", "small motions need drivers"),
        ({"polynomial": [0.0, 1.0]}, "its axis is not parallel to gravity", "not along gravity"),
        ({}, "no degree of freedom", "no degree of freedom"),
        (None, r"body\[rod\].mass: is missing", r"body\[rod\].mass: is missing"),
    ],
)
def test_scene_without_equilibria_is_refused_with_the_driver_or_mass_that_is_the_cause(change, says, judged):
    """A driver accelerates, oscillates, turns across gravity or holds all freedoms; or a mass is missing
    (None). mbref and the judge have sentences of their own."""
    bare = {"body": [{"name": "rod", "position": [ARM, 0.0, 0.0]}]}
    scene = pendulum().with_(**bare if change is None else {"driver": [{"joint": "A", **change}]})
    for search, sentence in ((equilibria, says), (steady_poses, judged)):
        with pytest.raises(SceneError, match=sentence):
            search(scene)


def test_vibration_keeps_the_constraints_and_returns_after_its_period():
    """A rhombus of 0.5 m swings by 0.05 rad, so that its coupler moves by 0.5 m · 0.05, to second order. The
    motion begins at its largest displacement, and ends there after a period 1 / f."""
    [each] = [e for e in equilibria(find_scene("four_bar_gravity"), starts=6) if e.stability == "stable"]
    motion = motion_of_mode(each, 1, amplitude=0.05)
    rounding = 1e-12  # m
    assert motion.violation.position.max() < rounding
    assert motion.times[-1] == pytest.approx(1 / each.frequencies[0])
    moved = motion.position - np.array([b.position for b in each.scene.body])
    assert np.abs(moved[0]).max() == pytest.approx(np.abs(moved).max())
    assert np.abs(moved[0]).max() == pytest.approx(0.5 * 0.05, rel=0.05**2)
    assert np.allclose(motion.position[0], motion.position[-1], rtol=0, atol=rounding)


def test_command_equilibrium_prints_stability_and_reactions_and_writes_the_pose(tmp_path, capsys):
    """The arm rests below and above its hinge, which carries m g = 19.62 N. The file has one pose (POSE)."""
    path, rest = (str(tmp_path / name) for name in ("my.toml", "rest.toml"))
    pendulum().save(path)
    assert main(["equilibrium", path, "--starts", "6", "--out", rest]) == 0
    shown = capsys.readouterr().out
    assert "equilibrium 1: unstable\n" in shown and "equilibrium 2: stable\n" in shown
    assert "Other equilibria may exist" in shown
    assert "force (0, 19.62, 0) N" in shown
    assert np.allclose(np.abs(Scene.from_file(rest).body[0].position), (0.0, ARM, 0.0), rtol=0, atol=POSE)


def test_command_modes_prints_the_frequency_of_a_pendulum_and_draws_its_vibration(tmp_path, capsys):
    """The frequency is √(m g l / (J + m l²)) / 2π."""
    frequency = np.sqrt(MASS * G * ARM / (INERTIA + MASS * ARM**2)) / (2 * np.pi)
    path, picture = str(tmp_path / "my.toml"), tmp_path / "mode.svg"
    pendulum().save(path)
    assert main(["modes", path, "--starts", "6", "--out", str(picture)]) == 0
    assert f"vibration 1: {frequency:.6g}" in capsys.readouterr().out and "<animate" in picture.read_text()


def test_number_of_an_equilibrium_beyond_those_found_is_refused(tmp_path, capsys):
    """The pendulum has two equilibria, below and above its hinge; the ninth is asked for."""
    pendulum().save(path := tmp_path / "my.toml")
    assert main(["equilibrium", str(path), "--starts", "2", "--number", "9"]) == 2
    assert "--number: must be from 1 to 2, got 9" in capsys.readouterr().err


def test_moment_that_allows_no_rest_is_named(tmp_path, capsys):
    """20 N m are more than the weight resists, m g l = 13.7 N m."""
    path = str(tmp_path / "pushed.toml")
    pendulum(load=[{"type": "moment", "body": "rod", "moment": [0.0, 0.0, 20.0]}]).save(path)
    assert main(["equilibrium", path, "--starts", "2"]) == 2
    said = capsys.readouterr().err
    assert "no equilibrium is found from 2 starts; perhaps load[0] (moment) moves it at every pose" in said
