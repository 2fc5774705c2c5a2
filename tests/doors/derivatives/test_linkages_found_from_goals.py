"""mbref design: links whose points follow a path or whose outputs are least, against closed forms."""

import json

import numpy as np
import pytest

import mbref
from mbref.cli import main
from mbref.scene import Scene
from tests.helpers.changed_scenes import in_other_units
from tests.helpers.coupled_mechanisms import body
from tests.helpers.parts import hinge

FOUND = 1e-8  # m, error of links of 1 m that is allowed
TURN = 2 * np.pi  # rad/s: the crank turns once a second
PINS = {"A": 0.0, "B": 0.3 + 0.4j, "C": 1.6 + 1.5j, "D": 2.0 + 0.1j}  # x + i y at t = 0
POINT = 1.2 + 1.6j  # of the coupler
TIMES = np.linspace(0.05, 0.9, 9)
XY = ("coupler.position.x", "coupler.position.y")
PATHS = [f"joint[{pin}].anchor.{axis}" for pin in PINS for axis in "xy"]
PATHS += [f"body[coupler].position.{axis}" for axis in "xy"]


def four_bar(pins: dict[str, complex], point: complex) -> Scene:
    """Return a driven four-bar A B C D whose coupler has its centre of mass at a point."""
    at = {name: (complex(z).real, complex(z).imag, 0.0) for name, z in {**pins, "P": point}.items()}
    links = {"crank": at["A"], "coupler": at["P"], "rocker": at["D"]}
    bodies = [body(name, 1.0, [0.01, 0.02, 0.02], place) for name, place in links.items()]
    ends = {"A": ("ground", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker")}
    joints = [hinge(pin, *pair, at[pin]) for pin, pair in {**ends, "D": ("ground", "rocker")}.items()]
    driver = [{"joint": "A", "polynomial": [0.0, TURN]}]
    return Scene(name="four_bar", duration=1.0, body=bodies, joint=joints, driver=driver)


def coupler_path(pins: dict[str, complex], point: complex, times: np.ndarray) -> np.ndarray:
    """Return the coupler's point x + i y at times: B turns about A, circles about B and D meet at C, and the
    point keeps its place between B and C."""
    a, b, c, d = pins.values()
    side = np.sign(((c - b) * np.conj(d - b)).imag)  # of the line from B to D on which C is
    turned = a + (b - a) * np.exp(1j * TURN * times)
    coupler, rocker, apart = abs(c - b), abs(d - c), np.abs(d - turned)
    along = (coupler**2 - rocker**2 + apart**2) / (2 * apart)
    height = side * np.sqrt(coupler**2 - along**2)
    return turned + (point - b) / (c - b) * (along + 1j * height) * (d - turned) / apart


def path_of(pins: dict[str, complex], point: complex, timed: bool = True) -> dict[str, np.ndarray]:
    z = coupler_path(pins, point, TIMES)
    return {**({"time": TIMES} if timed else {}), XY[0]: z.real, XY[1]: z.imag}


def rough(size: float, seed: int, labels: list[str]) -> Scene:
    """Return the four-bar with numbers changed by up to ``size`` m, at random."""
    scene, random = four_bar(PINS, POINT), np.random.default_rng(seed)
    for label, value in zip(PATHS, true_numbers(), strict=True):
        change = size * random.uniform(-1, 1)
        scene = scene.with_(label, value + change * (label in labels))
    return scene


def true_numbers() -> np.ndarray:
    return np.array([part for z in (*PINS.values(), POINT) for part in (complex(z).real, complex(z).imag)])


def lengths(numbers: np.ndarray) -> np.ndarray:
    """Return the lengths of crank, coupler, rocker and ground, and distances of the point from B and C."""
    a, b, c, d, point = numbers[::2] + 1j * numbers[1::2]
    return np.abs([b - a, c - b, d - c, d - a, point - b, point - c])


def numbers_of(scene: Scene) -> np.ndarray:
    """Return the numbers at ``PATHS``."""
    points = [joint.anchor for joint in scene.joint] + [scene.body[1].position]
    return np.array([x for point in points for x in point[:2]])


@pytest.mark.parametrize("labels", [PATHS[2:4], pytest.param(PATHS, marks=pytest.mark.slow)], ids=["2", "10"])
def test_four_bar_through_nine_timed_points_of_a_known_one_is_found_again(labels):
    """``coupler_path`` is the closed form of the known four-bar, from which the start is up to 0.15 m off."""
    found = mbref.synthesise(rough(0.15, 1, labels), labels, follow=path_of(PINS, POINT), starts=1)
    assert found.reached and found.converged and not found.undetermined
    np.testing.assert_allclose(numbers_of(found.scene), true_numbers(), rtol=0, atol=FOUND)


@pytest.mark.slow
def test_links_through_nine_points_without_times_are_found_but_not_when_the_crank_starts():
    """The same path is passed for each angle of the crank at t = 0, with other times of the points: links are
    determined, and one combination of numbers and times is not."""
    found = mbref.synthesise(rough(0.05, 1, PATHS), PATHS, follow=path_of(PINS, POINT, timed=False), starts=1)
    assert found.reached
    np.testing.assert_allclose(lengths(numbers_of(found.scene)), lengths(true_numbers()), rtol=0, atol=FOUND)
    np.testing.assert_allclose(np.diff(found.times), np.diff(TIMES), rtol=0, atol=FOUND)
    (combination,) = found.undetermined
    assert {"joint[B].anchor.x", "time of point 1"} <= combination.keys()


def hoeken(rocker: float) -> tuple[dict[str, complex], complex]:
    """Return pins and point of Hoeken's linkage at a quarter turn: crank 1, ground 2, coupler and rocker 2.5,
    and a point twice as far from B as C is; here with another rocker."""
    b, d = 1j, 2.0 + 0j
    apart = abs(d - b)
    along = (2.5**2 - rocker**2 + apart**2) / (2 * apart)
    c = b + (along + 1j * np.sqrt(2.5**2 - along**2)) * (d - b) / apart
    return {"A": 0.0, "B": b, "C": c, "D": d}, b + 2 * (c - b)


def off_the_line(pins: dict[str, complex], point: complex) -> float:
    """Return the largest distance of the point from the line y = 4 over a third of a turn, by closed form."""
    return float(np.abs(coupler_path(pins, point, np.linspace(1 / 12, 5 / 12, 401)).imag - 4.0).max())


@pytest.mark.slow
def test_rough_straight_line_linkage_becomes_straighter_than_hoekens():
    """The start has a rocker 6 % too long. The family contains Hoeken's linkage, so the best one is as good.
    Distances from the line are by closed form, also between the 41 points that are followed."""
    pins, point = hoeken(2.65)
    labels = [f"joint[{pin}].anchor.{axis}" for pin in "CD" for axis in "xy"] + PATHS[-2:]
    line = {"time": np.linspace(1 / 12, 5 / 12, 41), "coupler.position.y": np.full(41, 4.0)}
    found = mbref.synthesise(four_bar(pins, point), labels, follow=line, peak=True, starts=1)
    z = numbers_of(found.scene)[::2] + 1j * numbers_of(found.scene)[1::2]
    straight = off_the_line(dict(zip("ABCD", z[:4], strict=True)), z[4])
    assert straight <= off_the_line(pins, point) / 50
    assert straight <= off_the_line(*hoeken(2.5))
    assert np.abs(found.residuals).max() <= straight <= 1.1 * np.abs(found.residuals).max()


def arm(x: float = 0.9, y: float = 0.0) -> Scene:
    """Return an arm that a driver turns about the origin; its centre of mass is at (x, y)."""
    bodies = [body("arm", 2.0, [0.1, 0.1, 0.1], (x, y, 0.0))]
    driver = [{"joint": "A", "polynomial": [0.0, TURN]}]
    joints = [hinge("A", "ground", "arm", (0.0, 0.0, 0.0))]
    parts = {"body": bodies, "joint": joints, "driver": driver}
    return Scene(name="arm", gravity=(0.0, -9.81, 0.0), duration=1.0, **parts)


ARM = ["body[arm].position.x", "body[arm].position.y"]
ARM_TIMES = np.array([0.1, 0.3, 0.6, 0.8])
# places in the arm that the points ask for; no arm has all of them
ASKED = np.array([1.0 + 0.1j, 1.2 + 0.2j, 1.1 + 0.4j, 1.3 + 0.1j])


def arm_points() -> dict[str, np.ndarray]:
    z = ASKED * np.exp(1j * TURN * ARM_TIMES)
    return {"time": ARM_TIMES, "arm.position.x": z.real, "arm.position.y": z.imag}


def test_points_that_no_arm_reaches_leave_the_residuals_of_their_mean():
    """A turn of the plane keeps distances, so that the best place in the arm is the mean of those asked for,
    and the residuals are the distances from it."""
    found = mbref.synthesise(arm(), ARM, follow=arm_points(), starts=2)
    mean = ASKED.mean()
    assert found.converged and not found.reached
    np.testing.assert_allclose([*found.numbers.values()], [mean.real, mean.imag], rtol=0, atol=FOUND)
    np.testing.assert_allclose(np.hypot(*found.residuals.T), np.abs(ASKED - mean), rtol=0, atol=FOUND)
    assert found.starts == pytest.approx([found.starts[0]] * 2, rel=1e-9)  # one minimum, from both starts


def test_points_without_times_determine_the_radius_of_an_arm_but_not_its_first_angle():
    """Points 1.2 m from the pivot, an eighth of a turn apart; other first angles pass them at other times."""
    z = 1.2 * np.exp(1j * TURN * np.array([0.3, 0.425, 0.55]))
    points = {"arm.position.x": z.real, "arm.position.y": z.imag}
    found = mbref.synthesise(arm(), ARM, follow=points, starts=1)
    assert found.reached and np.hypot(*found.numbers.values()) == pytest.approx(1.2, abs=FOUND)
    np.testing.assert_allclose(np.diff(found.times), [1 / 8, 1 / 8], rtol=0, atol=FOUND)
    (combination,) = found.undetermined
    assert {ARM[1], "time of point 1"} <= combination.keys()


def test_least_peak_of_one_coordinate_is_between_its_extremes():
    """At t = 0 and after whole turns the x of the arm is its position: the middle of 1.0 and 1.3."""
    points = {"time": np.array([0.0, 1.0, 2.0]), "arm.position.x": np.array([1.0, 1.05, 1.3])}
    found = mbref.synthesise(arm(), ARM[:1], follow=points, peak=True, starts=1)
    assert found.numbers[ARM[0]] == pytest.approx(1.15, abs=FOUND)
    np.testing.assert_allclose(found.residuals[:, 0], [0.15, 0.1, -0.15], rtol=0, atol=FOUND)


def test_number_ends_at_its_bound_and_the_other_one_where_it_is_best():
    """The mean of the places is (1.15, 0.2); x and y do not influence each other."""
    found = mbref.synthesise(arm(), ARM, follow=arm_points(), bounds={ARM[0]: (0.5, 1.05)}, starts=1)
    assert found.numbers[ARM[0]] == 1.05
    assert found.numbers[ARM[1]] == pytest.approx(0.2, abs=FOUND)
    assert found.at_bounds == {ARM[0]: "upper"}


def test_result_does_not_depend_on_units_nor_on_the_order_of_numbers():
    """Lengths are a thousand times smaller, and times a hundred times; numbers are in reverse order."""
    by_own = mbref.synthesise(arm(), ARM, follow=arm_points(), starts=1)
    small = in_other_units(arm(), mass=1.0, length=1e-3, time=1e-2)
    points = arm_points()
    follow = {name: values * (1e-2 if name == "time" else 1e-3) for name, values in points.items()}
    found = mbref.synthesise(small, ARM[::-1], follow=follow, starts=1)
    for name in ARM:
        assert found.numbers[name] == pytest.approx(1e-3 * by_own.numbers[name], rel=1e-9)


def test_least_torque_moves_the_mass_to_the_height_of_the_pivot_and_its_lower_bound():
    """A mass at (x, y) from the pivot needs the torque m g (x cos φ - y sin φ), of mean square (m g)² (x² +
    y²) / 2 over a turn: the least has y = 0 and x at its lower bound, 0.1 m."""
    times = np.linspace(0.0, 1.0, 17)[:-1]
    wanted = {"least": ["driver(A).torque"], "bounds": {ARM[0]: (0.1, 1.0)}}
    found = mbref.synthesise(arm(0.5, 0.2), ARM, times=times, starts=1, **wanted)
    assert found.numbers[ARM[0]] == 0.1 and found.at_bounds == {ARM[0]: "lower"}
    assert found.numbers[ARM[1]] == pytest.approx(0.0, abs=FOUND)
    square = (2.0 * 9.81 * 0.1) ** 2 / 2
    assert np.mean(found.residuals**2) == pytest.approx(square, rel=1e-8)


def test_start_whose_crank_cannot_turn_is_left_for_a_random_one():
    """With the crank's pin at (1.2, 0.4) the shortest and longest link are longer than the others together,
    so that the crank does not turn (Grashof). Random starts are within the bounds."""
    labels = PATHS[2:4]
    scene = four_bar({**PINS, "B": 1.2 + 0.4j}, POINT)
    bounds = {labels[0]: (0.1, 1.25), labels[1]: (0.1, 0.9)}
    found = mbref.synthesise(scene, labels, follow=path_of(PINS, POINT), bounds=bounds, starts=2)
    assert found.starts[0] is None and found.refused > 0 and "dead position" in found.last_reason
    assert found.reached
    np.testing.assert_allclose(numbers_of(found.scene), true_numbers(), rtol=0, atol=FOUND)


def test_search_that_a_singular_position_stops_has_not_converged():
    """The path asks for a crank that is too long to turn. A further column is the height z of the crank's
    centre, which nothing else changes: at any minimum it is as wanted, 0.9 m."""
    labels, path = [*PATHS[2:4], "body[crank].position.z"], path_of(PINS, POINT)
    far = {name: path[name] + 3 * (path[name] - path[name][0]) for name in XY}
    wanted = {**path, **far, "crank.position.z": np.full(TIMES.size, 0.9)}
    found = mbref.synthesise(four_bar(PINS, POINT), labels, follow=wanted, starts=1)
    assert found.refused and abs(found.numbers[labels[2]] - 0.9) > FOUND and not found.converged


def test_command_writes_the_scene_and_says_that_points_are_not_reached(tmp_path, capsys):
    """The scene has the mean, (1.15, 0.2), with x at its bound 1.1; an empty cell gives no condition."""
    arm().save(tmp_path / "arm.toml")
    (tmp_path / "points.csv").write_text("time, arm.position.x,arm.position.y\n0.0,1.15,0.2\n1.0,1.15,\n\n")
    files = ["--follow", str(tmp_path / "points.csv"), "--out", str(tmp_path / "found.toml")]
    let = ["--let", f"{ARM[0]} 0.5 1.1", "--let", ARM[1]]
    assert main(["design", str(tmp_path / "arm.toml"), *let, *files, "--starts", "1"]) == 0
    printed = capsys.readouterr().out
    assert "not all points are reached" in printed and f"at its upper bound: {ARM[0]}" in printed
    assert mbref.find_scene(tmp_path / "found.toml").body[0].position[:2] == pytest.approx((1.1, 0.2))
    assert main(["design", str(tmp_path / "arm.toml"), *let, *files[:2], "--starts", "1", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["at_bounds"] == {ARM[0]: "upper"} and record["residuals"][1][1] is None
    np.testing.assert_allclose([row[0] for row in record["residuals"]], [-0.05, -0.05], rtol=0, atol=FOUND)


def test_command_takes_a_number_of_a_body_whose_name_has_blanks(tmp_path, capsys):
    """``--let`` has the path of a number and its least and largest value; the name in the path has a blank.
    At 0 s the arm is as in the scene, so that the point of the file asks for x = 1 m instead of 0.9 m."""
    scene = arm().to_dict()
    scene["body"][0]["name"] = scene["joint"][0]["bodies"][1] = "first arm"
    Scene(**scene).save(tmp_path / "arm.toml")
    (tmp_path / "points.csv").write_text("time,first arm.position.x\n0.0,1.0\n")
    let = ["--let", "body[first arm].position.x 0.5 1.1", "--follow", str(tmp_path / "points.csv")]
    assert main(["design", str(tmp_path / "arm.toml"), *let, "--starts", "1"]) == 0
    assert "body[first arm].position.x = 1\n" in capsys.readouterr().out


def test_least_peak_of_points_that_the_start_already_reaches_converges():
    """The arm moves in the plane z = 0, as asked: residuals are zero, and give steps no scale."""
    found = mbref.synthesise(arm(), ARM, follow={"time": [0.0], "arm.position.z": [0.0]}, peak=True, starts=1)
    assert found.reached and found.converged


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"let": ["body[arm].position"]}, r"body\[arm\].position: the scene has no number"),
        ({"let": ["joint[A].angle(0)"]}, r"let: joint\[A\].angle\(0\) is a number of the start"),
        ({"let": ARM, "bounds": {ARM[0]: (1.0, 2.0)}}, r"bounds: body\[arm\].position.x is 0.9 in the scene"),
        ({"let": ARM, "bounds": {"gravity.y": (1.0, 2.0)}}, "bounds: gravity.y is none of the numbers"),
        ({"let": ARM, "follow": {"arm.position": np.ones(2)}}, "follow: name whole columns: arm.position.x"),
        ({"let": ARM, "follow": {"energy": np.ones(2)}}, "follow: energy needs a column time"),
        ({"let": ARM, "follow": {"hand.position.x": np.ones(2)}}, "no column 'hand.position.x'"),
        ({"let": ARM, "least": ["energy"]}, "give a goal"),
        ({"let": ARM, "follow": None, "least": ["A.open"]}, "least: A.open has no derivative"),
    ],
)
def test_faulty_request_is_refused_by_name(request_, message):
    with pytest.raises((mbref.InputError, mbref.SceneError), match=message):
        mbref.synthesise(arm(), **{"follow": arm_points(), "starts": 1, **request_})
