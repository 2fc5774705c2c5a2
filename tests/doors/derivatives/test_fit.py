"""Numbers of scenes from measured columns: planted values are found again, to their standard errors."""

import numpy as np
import pytest

import mbref
from mbref.cli import main
from mbref.scene import Scene
from tests.doors.derivatives.test_sensitivities import pendulum
from tests.helpers.changed_scenes import in_other_units
from tests.helpers.coupled_mechanisms import body
from tests.helpers.parts import slide
from tests.helpers.short_motions import MOTIONS

NOISE = 1e-3  # rad, standard deviation of the errors of a measured angle
MOST_DEVIATIONS = 4.0  # standard errors; a normal error is larger once in 16 000


@pytest.mark.slow
def test_planted_spring_is_found_from_a_noisy_angle_to_its_standard_errors():
    """The scene's own stiffness, natural angle and mass, ``true``, are found from 20 % more, by the angle of
    its exact run with normal errors of 1e-3 rad."""
    scene, times = MOTIONS["pendulum with torsion spring"](), np.linspace(0.02, 0.5, 60)
    column = mbref.simulate(scene, times=times).columns("A.angle")
    column["A.angle"] += np.random.default_rng(3).normal(scale=NOISE, size=times.size)
    true = {"load[0].stiffness": 5.0, "load[0].natural_angle": 1.5, "body[b].mass": 0.7}
    rough = scene
    for number, value in true.items():
        rough = rough.with_(number, 1.2 * value)
    found = mbref.fit(rough, column, list(true))
    assert found.converged
    assert found.deviations["A.angle"] == pytest.approx(NOISE, rel=0.3)  # by chance 1 / √(2 · 60) = 9 %
    for number, value in true.items():
        assert abs(found.numbers[number] - value) <= MOST_DEVIATIONS * found.errors[number]


def test_command_names_the_combination_that_an_angle_does_not_determine(tmp_path, capsys):
    """A pendulum's angle depends on the ratio of inertia and mass: equal relative changes, the direction
    (1, 1)/√2 = 0.707 (1, 1), have no effect: infinite errors. The file has decimal commas."""
    pendulum().save(tmp_path / "scene.toml")
    mbref.simulate(pendulum(), times=[0.2, 0.4, 0.6]).to_csv(tmp_path / "run.csv", decimal_comma=True)
    free = ["--of", "A.angle", "--free", "body[bob].mass", "--free", "body[bob].inertia[2]"]
    assert main(["fit", *map(str, (tmp_path / "scene.toml", tmp_path / "run.csv")), *free]) == 0
    printed = capsys.readouterr().out.replace("-0.707", "+0.707")
    assert "+0.707 (body[bob].mass) +0.707 (body[bob].inertia[2])" in printed
    assert printed.count("standard error inf") == 2


def test_constant_column_counts_no_more_than_others():
    """The measured angle is of a pendulum of 1.3 kg; the fit begins at 1.5 kg. A second column, a position
    across the plane, is constant at 0.1 m where the scene has 0, so that no mass fits it, and its deviation
    by which columns are weighted is rounding. A fit of a column without noise is exact to 1e-6."""
    times, wrong = np.array([0.1, 0.2, 0.3]), pendulum().with_("body[bob].mass", 1.5)
    columns = mbref.simulate(pendulum(), times=times).columns("A.angle")
    found = mbref.fit(wrong, {**columns, "bob.position.z": np.full(3, 0.1)}, ["body[bob].mass"])
    assert found.numbers["body[bob].mass"] == pytest.approx(1.3, rel=1e-6)


def test_fit_of_a_tiny_pendulum_finds_its_pivot_and_gravity():
    """Lengths of the pendulum and gravity are 1e-8 times as large in SI units, so that its angle is the same;
    the fit begins with the pivot 1 % off, at zero, and with 10 % more gravity."""
    tiny, times = in_other_units(pendulum(), mass=1.0, length=1e-8, time=1.0), np.array([0.1, 0.2, 0.3, 0.4])
    true = {"joint[A].anchor.x": 5e-11, "gravity.y": -9.81e-8}
    columns = mbref.simulate(tiny.with_("joint[A].anchor.x", 5e-11), times=times).columns("A.angle")
    found = mbref.fit(tiny.with_("gravity.y", -1.08e-7), columns, list(true))
    assert not found.undetermined
    for number, value in true.items():
        assert found.numbers[number] == pytest.approx(value, rel=1e-5)


def damped_cart(unit: float, stiffness: float, damping: float, mass: float = 2.0) -> Scene:
    """Return a cart that a spring pulls from rest over 0.1 m. Masses, and so forces, are in a unit (kg)."""
    spring = {"stiffness": stiffness * unit, "damping": damping * unit, "natural_displacement": 0.1}
    load = {"type": "slide_spring", "joint": "S", **spring}
    cart = body("cart", mass * unit, [0.1 * unit] * 3, (0.0, 0.0, 0.0))
    return Scene(name="cart", body=[cart], joint=[slide("S", "ground", "cart", (0.0, 0.0, 0.0))], load=[load])


@pytest.mark.parametrize(("unit", "damping"), [(1.0, 1e-9), (1e-9, 0.0)])
def test_number_that_starts_far_below_its_value_is_determined(unit, damping):
    """The true stiffness is 50 and the damping 1.5 (N/m and N s/m, times the unit). Standard errors are those
    of a fit that starts at these. Without a known mass, equal relative changes of all have no effect."""
    times, free = np.linspace(0.05, 1.0, 20), ["load[0].stiffness", "load[0].damping"]
    columns = mbref.simulate(damped_cart(unit, 50.0, 1.5), times=times).columns("S.displacement")
    columns["S.displacement"] += np.random.default_rng(1).normal(scale=NOISE, size=times.size)
    found, near = (
        mbref.fit(damped_cart(unit, *rough), columns, free) for rough in ((40, damping), (50, 1.5))
    )
    for number, error in near.errors.items():
        assert found.errors[number] == pytest.approx(error, rel=1e-3)
        assert found.numbers[number] == pytest.approx(near.numbers[number], abs=1e-3 * error)
    [open_] = mbref.fit(damped_cart(unit, 40.0, 1.2, 1.7), columns, [*free, "body[cart].mass"]).undetermined
    np.testing.assert_allclose(np.abs([*open_.values()]), 3**-0.5, rtol=1e-3)


def test_standard_error_of_a_number_is_by_the_scatter_of_the_columns_that_determine_it():
    """Forces F push two carts: x = F g with g = t²/(2 m). The regression of each column alone has the
    standard error √(Σ r²/(k - 1)/Σ g²); one column is measured 1000 times as accurately as the other."""
    times, random, masses = np.linspace(0.05, 1.0, 20), np.random.default_rng(0), {"A": 2.0, "B": 3.0}
    bodies = [body(name, mass, [0.1] * 3, (mass, 0.0, 0.0)) for name, mass in masses.items()]
    slides = [slide(name, "ground", name, (mass, 0.0, 0.0)) for name, mass in masses.items()]
    pushes = [{"type": "joint_force", "joint": name, "force": 4.0} for name in masses]
    scene = Scene(name="carts", body=bodies, joint=slides, load=pushes)
    columns, true = {"time": times}, []
    for (name, mass), noise in zip(masses.items(), (1e-4, 0.1), strict=True):
        g = times**2 / (2.0 * mass)
        columns[f"{name}.displacement"] = x = 4.0 * g + random.normal(scale=noise, size=times.size)
        rest = x - g * (g @ x) / (g @ g)
        true.append(np.sqrt(rest @ rest / (times.size - 1) / (g @ g)))
    found = mbref.fit(scene, columns, ["load[0].force", "load[1].force"])
    np.testing.assert_allclose([*found.errors.values()], true, rtol=1e-6)


def test_opposite_quaternions_are_one_measured_orientation():
    """The measured orientation of the pendulum has w ≤ 0, as another tool may write it, mbref's has w > 0."""
    times = np.array([0.1, 0.2, 0.3])
    columns = mbref.simulate(pendulum(), times=times).columns("bob.orientation.w", "bob.orientation.z")
    measured = {name: values if name == "time" else -values for name, values in columns.items()}
    found = mbref.fit(pendulum().with_("body[bob].mass", 1.5), measured, ["body[bob].mass"])
    assert found.numbers["body[bob].mass"] == pytest.approx(1.3, rel=1e-6)


def test_angle_that_loses_full_turns_is_refused_with_its_samples():
    """The pendulum turns by 4 rad in 0.4 s, which a table between -π and π shows as 4 - 2 π = -2.28 rad."""
    spinning = pendulum().with_(gravity=(0.0, 0.0, 0.0)).with_("body[bob].angular_velocity", (0.0, 0.0, 10.0))
    times = np.array([0.1, 0.2, 0.3, 0.4])
    measured = {"time": times, "A.angle": np.array([1.0, 2.0, 3.0, 4.0 - 2.0 * np.pi])}
    with pytest.raises(mbref.InputError, match=r"A\.angle changes by -5\.283 rad from t = 0\.3 to 0\.4 s"):
        mbref.fit(spinning, measured, ["body[bob].mass"])


def test_table_with_units_in_its_names_is_refused_with_a_column(tmp_path):
    """``mbref run --units deg`` writes them; numbers in degrees would be fitted as radians."""
    mbref.simulate(pendulum(), times=[0.2, 0.4]).to_csv(tmp_path / "run.csv", units="deg")
    with pytest.raises(mbref.InputError, match=r"column 'time \[s\]' has a unit; give SI units"):
        mbref.fit(pendulum(), tmp_path / "run.csv", ["gravity.y"])
