"""Scenes of any size move as their equations of few freedoms say, and refuse sizes that they do not have."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crosscheck import measure
from mbref import Limits, SceneError, simulate
from mbref.scenes import find_scene

G = 9.81  # m/s²
CLOSE = 1e-8  # m: a hundred tolerances of the runs
EXACT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
METHODS = ("taylor", "alf-dual+projection")


def motion_of(name, method, end):
    scene = find_scene(name)
    run = simulate(scene, method, [0.0, end], Limits(rtol=1e-10))
    assert run.outcome.name == "COMPLETED"
    return {body.name: run.position[:, k] for k, body in enumerate(scene.body)}, run


@pytest.mark.parametrize("method", METHODS)
def test_floors_of_a_lattice_are_pendulums_on_pendulums(method):
    """Uprights of a floor stay parallel, and its bars horizontal. Lagrange's equations of the angles a from
    the vertical are Σ M_ij cos(a_i - a_j) a_j'' = g c_i sin a_i - Σ M_ij sin(a_i - a_j) a_j'². A floor
    carries c_i = half of its uprights, its bars and all floors above; M_ij = c of the higher floor, and M_ii
    counts the uprights by their moment about the foot. All are rods of 1 kg, 1 m and radius 0.01 m."""
    columns, floors, end = 2, 3, 0.2
    above = np.arange(floors)[::-1] * (2.0 * columns + 1)  # kg of all higher floors
    carried = (columns + 1) / 2 + columns + above
    own = (columns + 1) * (1 / 4 + (3 * 0.01**2 + 1) / 12) + columns + above
    higher = np.maximum(np.arange(floors)[:, None], np.arange(floors))
    mass = np.where(np.eye(floors, dtype=bool), np.diag(own), carried[higher])

    def rate(_, y):
        angle, speed = np.split(y, 2)
        apart = angle[:, None] - angle
        torque = G * carried * np.sin(angle) - mass * np.sin(apart) @ speed**2
        return [*speed, *np.linalg.solve(mass * np.cos(apart), torque)]

    bodies, _ = motion_of(f"lattice[{columns},{floors}]", method, end)
    lean = np.array([0.3 * (-1) ** k + 0.05 * k / floors for k in range(floors)])  # rad, at the start
    angles = solve_ivp(rate, (0.0, end), [*lean, *np.zeros(floors)], **EXACT).y[:floors, -1]
    foot = np.zeros(2)
    for floor, angle in enumerate(angles):
        up = np.array([np.sin(angle), np.cos(angle)])
        for i in range(columns + 1):
            assert bodies[f"upright{i}_{floor}"][1, :2] == pytest.approx(foot + [i, 0] + up / 2, abs=CLOSE)
        for i in range(columns):
            assert bodies[f"bar{i}_{floor}"][1, :2] == pytest.approx(up + foot + [i + 0.5, 0], abs=CLOSE)
        foot = foot + up


def test_platforms_of_a_sarrus_stack_fall_as_lagranges_equations():
    """Two levels, each of two pairs of bars (lower and upper, 0.5 m, 0.5 kg) at one angle a_k from the
    horizontal, which is 60° at the start. Platform k (1 kg) is 2 · 0.5 m · (sin a₀ + … + sin a_k) above the
    ground. Scipy integrates Lagrange's equations of a₀ and a₁: ``rises`` and ``reaches`` are the vertical and
    horizontal places of all bodies over sin a and cos a."""
    count, end, length, bar_mass, platform_mass = 2, 0.15, 0.5, 0.5, 1.0  # s, m, kg, kg
    across = bar_mass * (3 * 0.01**2 + length**2) / 12  # kg m², of a bar of radius 0.01 m about its middle
    heights = [[0.5, 0], [1.5, 0], [2, 0.5], [2, 1.5]]  # middles of bars / (length sin a): lower, upper, …
    tops = [[2, 0], [2, 2]]  # platforms / (length sin a)
    masses = np.array([2 * bar_mass] * 4 + [platform_mass] * 2)
    rises = length * np.array(heights + tops)
    reaches = length / 2 * np.array([[1, 0], [1, 0], [0, 1], [0, 1], [0, 0], [0, 0]])  # / cos a, outwards

    def rate(_, y):
        angle, speed = np.split(y, 2)
        c, s = np.cos(angle), np.sin(angle)
        up, out = rises * c, -reaches * s
        bent = (up.T @ (masses * (-(rises * s) @ speed**2)), out.T @ (masses * (-(reaches * c) @ speed**2)))
        matrix = (up.T * masses) @ up + (out.T * masses) @ out + 4 * across * np.eye(count)
        return [*speed, *np.linalg.solve(matrix, -up.T @ masses * G - sum(bent))]

    bodies, _ = motion_of(f"sarrus_stack[{count}]", "taylor", end)
    start = [*np.full(count, np.radians(60)), *np.zeros(count)]
    angles = solve_ivp(rate, (0.0, end), start, **EXACT).y[:count, -1]
    found = [bodies[f"platform{k}"][1, 2] for k in range(count)]
    assert found == pytest.approx(2 * length * np.cumsum(np.sin(angles)), abs=CLOSE)


@pytest.mark.parametrize("method", METHODS)
def test_joints_of_walking_legs_stay_closed_and_their_energy_constant(method):
    """While the crank turns by more than 0.1 rad, the judge finds joints closed to rounding, and the energy
    constant to ten tolerances, 1e-8; both are relative to the mechanism."""
    _, run = motion_of("strandbeest[2]", method, 0.1)
    assert abs(run.joint("O").angle[1]) > 0.1
    found = measure(run.mechanism, run)
    assert found["violation_position"] < 1e-12 and found["energy_error"] < 1e-8


def test_links_of_a_strandbeest_have_jansens_holy_numbers():
    """The truth are Theo Jansen's published lengths (cm), by his letters of links. A link has the names of
    its hinges; the axle O is 38.0 beside and 7.8 above each pivot Q. Rods have 1 kg/m."""
    scene = find_scene("strandbeest[3]")
    at = {joint.name: np.array(joint.anchor)[:2] * 100 for joint in scene.joint}
    mass = {body.name: body.mass * 100 for body in scene.body}
    holy = {  # link: its hinges, and their distance in cm
        **{"j": ("PT", 50.0), "k": ("RU", 61.9), "c": ("SU", 39.3), "f": ("WX", 39.4), "b": ("QT", 41.5)},
        **{"e": ("TW", 55.8), "d": ("QW", 40.1), "g": ("VX", 36.7), "m": ("OP", 15.0)},
    }
    for leg in "012":
        for link, ((first, second), length) in holy.items():
            ends = at[first if first == "O" else first + leg], at[second + leg]
            assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(length), link
        assert at["Q" + leg] - at["O"] == pytest.approx([-38.0, -7.8])
        masses = {"bde": 41.5 + 40.1 + 55.8, "ghi": 36.7 + 65.7 + 49.0, "k": 61.9}
        assert {link: mass[link + leg] for link in masses} == pytest.approx(masses)


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("lattice[3]", r"its size in brackets, lattice\[N,M\]"),
        ("strandbeest[1,2]", r"its size in brackets, strandbeest\[N\]"),
        ("strandbeest[9999]", "at most 10000 loops"),
        ("lattice[199,199]", "at most 10000 loops"),
        ("strandbest", "did you mean 'strandbeest'"),
    ],
)
def test_scene_of_a_size_that_its_family_does_not_have_is_refused_with_the_right_form(name, fault):
    """A lattice has two numbers, a strandbeest one; 10000 loops are the limit."""
    with pytest.raises(SceneError, match=fault):
        find_scene(name)
