"""Derivatives of motions by numbers of their scenes, against closed forms, relations and the judge."""

import json

import numpy as np
import pytest

import mbref
from crosscheck.judge.reference.reference import reference
from mbref.cli import main
from mbref.scene import Scene
from tests.helpers.changed_scenes import in_other_units
from tests.helpers.coupled_mechanisms import body, gear_pair
from tests.helpers.parts import hinge, slide
from tests.helpers.powered_mechanisms import powered_mechanism

ACCURATE = 1e-11  # relative error that is allowed against closed forms; rounding leaves 1e-13
MOST_ERRORS = 10.0  # true error / estimated error
IMAGINARY = 1e-30  # step of the derivative Im f(x + ih)/h of an analytic function, exact to rounding
GRAVITY, TURN_RATE = 9.81, 3.0  # m/s², rad/s
CENTRAL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # weights of differences of order 8


def slope(function, numbers: dict[str, complex], name: str) -> np.ndarray:
    """Return the derivative of an analytic function of named numbers."""
    return np.imag(function(**{**numbers, name: numbers[name] + 1j * IMAGINARY})) / IMAGINARY


def assert_close(found: np.ndarray, true: np.ndarray, accuracy: float = ACCURATE) -> None:
    np.testing.assert_allclose(found, true, rtol=0, atol=accuracy * np.abs(true).max())


def pendulum() -> Scene:
    """Return a compound pendulum that starts at rest."""
    bob = body("bob", 1.3, [0.05, 0.06, 0.07], (0.3, -0.4, 0.0))
    joint = [hinge("A", "ground", "bob", (0.0, 0.0, 0.0))]
    return Scene(name="pendulum", gravity=(0.0, -GRAVITY, 0.0), duration=3.0, body=[bob], joint=joint)


def angle_of_pendulum(times, mass, inertia, x, y, gravity, start):
    """Return φ(t) - φ₀ of sin(φ/2) = k cd(ω t, k), k = sin((φ₀ + start)/2), of a pendulum from rest whose
    centre of mass is given at (0.3, -0.4), φ₀ from the vertical, and whose hinge is at (x, y). Jacobi's cd is
    found by arithmetic-geometric means, which keep the function analytic."""
    length, given = np.sqrt((0.3 - x) ** 2 + (0.4 + y) ** 2), np.arctan((0.3 - x) / (0.4 + y))
    k = np.sin((given + start) / 2)
    a, b, ratios = 1.0 + 0j, np.sqrt(1 - k * k), []
    for _ in range(6):  # c/a squares itself each time
        a, b, c = (a + b) / 2, np.sqrt(a * b), (a - b) / 2
        ratios.append(c / a)
    rate = np.sqrt(-mass * gravity * length / (inertia + mass * length**2))
    phase = 2 ** len(ratios) * (a * rate * times + np.pi / 2)
    for ratio in reversed(ratios):
        phase = (phase + np.arcsin(ratio * np.sin(phase))) / 2
    return 2 * np.arcsin(k * np.sin(phase)) - given


SWUNG = np.array([0.3, 1.7])  # s
NUMBERS = {"mass": 1.3, "inertia": 0.07, "x": 0.0, "y": 0.0, "gravity": -GRAVITY, "start": 0.0}
WHEELS = {name: (float(k), 1.0, 0.0) for k, name in enumerate("BC")}
GEARS = {
    "body": [body(f"wheel {name}", 1.0, [0.1] * 3, place) for name, place in WHEELS.items()],
    "joint": [hinge(name, "ground", f"wheel {name}", place) for name, place in WHEELS.items()],
    "coupling": [{"name": "gears", "joints": ["B", "C"], "ratio": 1.5, "offset": 0.3}],
}


@pytest.mark.parametrize("beside", [{}, GEARS], ids=["alone", "gears that an offset moves"])
def test_derivatives_of_a_pendulums_angle_equal_those_of_jacobis_function(beside):
    """The closed form is differentiated by a complex step; stated errors are at least 1/10 of true ones."""
    scene = pendulum().with_(**{key: [*getattr(pendulum(), key), *parts] for key, parts in beside.items()})
    paths = ["body[bob].mass", "body[bob].inertia[2]", "joint[A].anchor.x", "joint[A].anchor.y"]
    found = mbref.sensitivities(scene, ["A.angle"], [*paths, "gravity.y", "joint[A].angle(0)"], SWUNG)
    for k, name in enumerate(NUMBERS):
        true = slope(lambda **n: angle_of_pendulum(SWUNG, **n), NUMBERS, name)
        assert_close(found.values[:, 0, k], true)
        assert (np.abs(found.values[:, 0, k] - true) <= MOST_ERRORS * found.errors[:, 0, k]).all()


@pytest.mark.parametrize("axis", np.eye(3).tolist())
def test_derivatives_of_a_driven_bodys_path_by_its_axis_equal_those_of_rodrigues_formula(axis):
    """A change δ across a unit axis u moves the point r, turned by θ about u, by (1 - cos θ)((δ·r) u + (u·r)
    δ) + sin θ δ × r; a change along u moves nothing. The pose at t = 0 stays."""
    times, bob = np.array([0.0, 0.4, 1.1]), body("bob", 1.3, [0.05, 0.06, 0.07], (0.3, -0.4, 0.2))
    joints = [hinge("A", "ground", "bob", (0.0, 0.0, 0.0), axis)]
    scene = Scene(name="driven", body=[bob], joint=joints, driver=[{"joint": "A", "polynomial": [0.0, 2.0]}])
    found = mbref.sensitivities(scene, ["bob.position"], [f"joint[A].axis.{k}" for k in "xyz"], times)
    u, r, turned = np.array(axis), np.array(bob["position"]), 2.0 * times[:, None, None]
    across = np.eye(3) - np.outer(u, u)
    true = (1 - np.cos(turned)) * (np.outer(across @ r, u) + (u @ r) * across)
    true = true + np.sin(turned) * np.cross(across, r)
    assert_close(found.values, true.swapaxes(1, 2))


def test_number_of_a_body_that_is_called_point_is_no_coordinate_of_a_point():
    """Steps of differences fit the inertia, 1e-6 kg m², not the length of the pendulum, 0.5 m."""
    bob = body("point", 1.3, [1e-6] * 3, (0.3, -0.4, 0.0))
    scene = pendulum().with_(body=[bob], joint=[hinge("A", "ground", "point", (0.0, 0.0, 0.0))])
    found = mbref.sensitivities(scene, ["A.angle"], ["body[point].inertia[2]"], SWUNG)
    true = slope(lambda **n: angle_of_pendulum(SWUNG, **n), {**NUMBERS, "inertia": 1e-6}, "inertia")
    assert_close(found.values[:, 0, 0], true)


SLIDER = slide("D", "ground", "last", (0.9, 0.5, 0.0))
ROCKER = hinge("D", "ground", "last", (1.0, 0.0, 0.0))


def crank_linkage(last: dict) -> Scene:
    """Return a driven crank and coupler whose pin C carries the last body."""
    pins = {"A": (0.0, 0.0, 0.0), "B": (0.2, 0.1, 0.0), "C": (0.9, 0.5, 0.0)}
    bodies = [body(name, 1.0, [0.01, 0.02, 0.02], (0.1, 0.1, 0.0)) for name in ("crank", "coupler", "last")]
    joints = [hinge("A", "ground", "crank", pins["A"]), hinge("B", "crank", "coupler", pins["B"])]
    joints += [hinge("C", "coupler", "last", pins["C"]), last]
    driver = [{"joint": "A", "polynomial": [0.0, TURN_RATE]}]
    return Scene(name="linkage", duration=1.0, body=bodies, joint=joints, driver=driver)


def turned_pin(times, bx, by):
    """Return x and y of the crank's pin B, which starts at (bx, by) and turns about the origin."""
    angle = TURN_RATE * times
    return np.cos(angle) * bx - np.sin(angle) * by, np.sin(angle) * bx + np.cos(angle) * by


def slid(times, bx, by, cx, cy):
    """Return the displacement of C on the line y = cy: √(l² - (cy - y_B)²) + x_B - cx."""
    x, y = turned_pin(times, bx, by)
    return np.sqrt((cx - bx) ** 2 + (cy - by) ** 2 - (cy - y) ** 2) + x - cx


def position_of_rocker(times, bx, by, cx, cy):
    """Return x of the rocker's centre, which turns with C - D; circles about B and D = (1, 0) meet at C."""
    x, y = turned_pin(times, bx, by)
    coupler, rocker = (cx - bx) ** 2 + (cy - by) ** 2, (cx - 1) ** 2 + cy**2
    apart = (1 - x) ** 2 + y**2
    along = (coupler - rocker + apart) / (2 * apart)
    height = np.sqrt(coupler / apart - along**2)
    px, py = x + along * (1 - x) + height * y - 1, y - along * y + height * (1 - x)
    cosine, sine = (px * (cx - 1) + py * cy) / rocker, (py * (cx - 1) - px * cy) / rocker
    return 1 + cosine * (0.1 - 1) - sine * 0.1  # its centre of mass starts at (0.1, 0.1)


@pytest.mark.parametrize(
    ("last", "output", "form"),
    [(SLIDER, "D.displacement", slid), (ROCKER, "last.position.x", position_of_rocker)],
    ids=["slider-crank", "four-bar"],
)
def test_positions_of_a_driven_linkage_depend_on_pins_as_in_closed_form_and_not_on_masses(last, output, form):
    """With the crank's pin at (x_B, y_B), the slider is displaced by √(l² - (y_C - y_B)²) + x_B - x_C; C of
    the four-bar is where circles about B and D meet. Their derivatives, by a complex step (``slope``), are
    the truth. No driver's motion depends on a mass."""
    times = np.array([0.2, 0.9])
    numbers = {"bx": 0.2, "by": 0.1, "cx": 0.9, "cy": 0.5}
    paths = ["joint[B].anchor.x", "joint[B].anchor.y", "joint[C].anchor.x", "joint[C].anchor.y"]
    found = mbref.sensitivities(crank_linkage(last), [output], [*paths, "body[last].mass"], times)
    true = np.array([slope(lambda **n: form(times, **n), numbers, name) for name in numbers]).T
    assert_close(found.values[:, 0, :4], true)
    assert np.abs(found.values[:, 0, 4]).max() <= 1e-13  # m/kg: rounding of positions of 1 m


@pytest.mark.parametrize("own_ratio", [-0.5, -1.0], ids=["unequal wheels", "equal wheels"])
def test_angle_of_geared_wheels_depends_on_ratio_and_inertia_as_in_closed_form(own_ratio):
    """φ = M t²/(2 (I₁ + r² I₂)) with the moment M = 2 N m, I₁ = 0.03 and I₂ = 0.2 kg m²; with r = -1 both
    factors of the coupling's row are the largest one, by which it is divided."""
    times, numbers = np.array([0.5, 2.0]), {"inertia": 0.2, "ratio": own_ratio}
    paths = ["body[wheel].inertia[2]", "coupling[teeth].ratio"]
    scene = gear_pair().with_("coupling[teeth].ratio", own_ratio)
    found = mbref.sensitivities(scene, ["A.angle"], paths, times)
    for k, name in enumerate(numbers):
        true = slope(lambda inertia, ratio: times**2 / (0.03 + ratio**2 * inertia), numbers, name)
        assert_close(found.values[:, 0, k], true)


def test_acceleration_by_a_short_spring_depends_on_its_ends_as_in_closed_form():
    """m a = -k (l - l₀) x/l, l² = x² + y², with m = 2 kg, k = 50 N/m, l₀ = 0.05 m, and the energy is
    k (l - l₀)²/2. The spring of 0.14 m is short beside the mechanism, whose second cart stands at 1 m."""
    carts = [body(name, 2.0, [0.1] * 3, (x, 0.0, 0.0)) for name, x in (("near", 0.1), ("far", 1.0))]
    ends = {"bodies": ["ground", "near"], "points": [[0.0, 0.1, 0.0], [0.1, 0.0, 0.0]]}
    load = [{"type": "spring", **ends, "stiffness": 50.0, "natural_length": 0.05}]
    joints = [slide(cart["name"], "ground", cart["name"], cart["position"]) for cart in carts]
    scene = Scene(name="carts", body=carts, joint=joints, load=load)

    def force_over_mass(x, y):
        return -50.0 / 2.0 * (1 - 0.05 / np.sqrt(x**2 + y**2)) * x

    def energy(x, y):
        return 50.0 / 2.0 * (np.sqrt(x**2 + y**2) - 0.05) ** 2

    of = ["near.acceleration.x", "load(0).energy"]
    found = mbref.sensitivities(scene, of, ["load[0].points[0].y"], [0.0])
    for values, function in zip(found.values[0], (force_over_mass, energy), strict=True):
        assert_close(values, np.array([slope(function, {"x": 0.1, "y": 0.1}, "y")]))


def test_torque_of_a_load_depends_on_its_sine_as_in_closed_form():
    """The torque 2 sin(ω t + φ) of a wheel has the derivatives 2 t cos(ω t + φ) and 2 cos(ω t + φ) by ω = 3
    and φ = 0, at t = 0, where sin φ has its inflection, and after ten turns of the phase."""
    factor = {"sine": {"amplitude": 1.0, "frequency": 3.0}}
    load = [{"type": "joint_torque", "joint": "A", "torque": 2.0, "factor": factor}]
    scene, times = pendulum().with_(gravity=(0.0, 0.0, 0.0), load=load), np.array([0.0, 21.0])
    to = [f"load[0].factor.sine.{name}" for name in ("frequency", "phase")]
    found = mbref.sensitivities(scene, ["load(0).torque"], to, times)
    by_phase = 2.0 * np.cos(3.0 * times)
    assert_close(found.values[:, 0], np.array([times * by_phase, by_phase]).T)
    first = mbref.sensitivities(scene, ["load(0).torque"], to[1:], times[:1])
    assert_close(first.values[:, 0, 0], by_phase[:1])
    assert max(found.errors.max(), first.errors.max()) < 42.0 * ACCURATE


def test_derivative_of_a_conserved_energy_stays_the_one_at_the_start():
    """The given velocities and places of the start do not depend on gravity, so that ∂E/∂g_y = -Σ m y there
    and at all times. The loop has redundant rows."""
    scene = mbref.find_scene("planar_slider_crank_gravity")
    found = mbref.sensitivities(scene, ["energy"], ["gravity.y"], [0.0, 0.1])
    true = -sum(b.mass * b.position[1] for b in scene.body)
    np.testing.assert_allclose(found.get("energy", "gravity.y"), true, rtol=ACCURATE)


def test_equilibrium_of_a_pendulum_with_a_torsion_spring_moves_as_in_closed_form():
    """At rest the pendulum hangs φ below the horizontal: k φ = m g l cos φ, with k = 10 N m/rad, m = 1.3 kg
    and l = 0.5 m. So dφ/dk = -φ / D and dφ/dg = m l cos φ / D with D = k + m g l sin φ. The hinge's angle is
    -φ, and gravity.y is -g. The hinge's force -m g_y balances the weight: its derivatives are 0 and -m."""
    bob = body("bob", 1.3, [0.05, 0.06, 0.07], (0.5, 0.0, 0.0))
    spring = {"type": "torsion_spring", "joint": "A", "stiffness": 10.0}
    rest = mbref.equilibria(pendulum().with_(body=[bob], load=[spring]), starts=1)[0].scene
    weight, angle = 1.3 * GRAVITY, -np.arctan2(rest.body[0].position[1], rest.body[0].position[0])
    of, to = ["A.angle", "A.force.y"], ["load[0].stiffness", "gravity.y"]
    found = mbref.equilibrium_sensitivities(rest, of, to)
    divisor = 10.0 + 0.5 * weight * np.sin(angle)
    true = [[angle / divisor, 0.5 * 1.3 * np.cos(angle) / divisor], [0.0, -1.3]]
    assert_close(found.values[0], np.array(true))


@pytest.mark.slow
def test_equilibrium_of_two_coupled_links_moves_with_their_pin_as_in_closed_form():
    """With angles a and b of the links from rest and natural angles n, n', the potential is g (m₁ y₁ + m₂ y₂)
    + 8 (a + b - n)²/2 + 15 (b - n')², as the wheel turns by a + b. Its gradient changes by (0, -m₂ g) if the
    pin moves along x, which leaves the pose."""
    bodies = [
        body("rod", 1.2, [0.01, 0.02, 0.03], (0.3, 0.05, 0.0)),
        body("arm", 0.7, [0.01, 0.02, 0.02], (0.8, 0.1, 0.0)),
        body("wheel", 0.5, [0.02, 0.02, 0.03], (-0.5, 0.0, 0.0)),
    ]
    ends = {"A": ("ground", "rod", (0.0, 0.0, 0.0)), "B": ("rod", "arm", (0.6, 0.1, 0.0))}
    ends["W"] = ("ground", "wheel", (-0.5, 0.0, 0.0))
    armature = {"A": 0.05, "B": 0.0, "W": 0.02}
    parts = {
        "joint": [hinge(name, *end, armature=armature[name]) for name, end in ends.items()],
        "coupling": [{"name": "s", "joints": [*ends], "ratios": [1.0, 1.0, -1.0]}],
        "load": [
            {"type": "torsion_spring", "joint": "W", "stiffness": 8.0, "damping": 0.3, "natural_angle": -14},
            {"type": "torsion_spring", "joint": "B", "stiffness": 30.0, "damping": 0.1},
        ],
    }
    scene = Scene(name="links", gravity=(0.0, -GRAVITY, 0.0), body=bodies, **parts)
    rest = mbref.equilibria(scene)[0].scene
    rod, arm, pin = (np.array(each) for each in (*(b.position for b in rest.body[:2]), rest.joint[1].anchor))
    both = 8.0 - 0.7 * GRAVITY * (arm - pin)[1]
    hessian = np.array([[8.0 - GRAVITY * (1.2 * rod[1] + 0.7 * arm[1]), both], [both, both + 30.0]])
    found = mbref.equilibrium_sensitivities(rest, ["A.angle", "B.angle"], ["joint[B].anchor.x"])
    assert_close(found.values[0, :, 0], np.linalg.solve(hessian, [0.0, 0.7 * GRAVITY]), 1e-9)


def test_driven_linkage_that_moves_or_accelerates_from_rest_is_not_in_equilibrium():
    """The driver turns the crank by t rad, or by t²: velocities then are zero, and accelerations are not."""
    for law, says in (([0, 0, 1], "in equilibrium; a driver"), ([0, 1], "at rest; the driver of 'A' moves")):
        scene = crank_linkage(ROCKER).with_(driver=[{"joint": "A", "polynomial": law}])
        with pytest.raises(mbref.InputError, match=f"is not {says}"):
            mbref.equilibrium_sensitivities(scene, ["B.force"], ["body[last].mass"])


@pytest.mark.slow
def test_derivative_in_other_units_is_scaled_by_the_units_of_output_and_number():
    """A velocity by a length is in 1/s. Times are a quarter, and so the derivative is four times as large."""
    mass, length, time = 8.0, 0.5, 0.25
    scene, times = powered_mechanism(2), np.array([0.02, 0.05])
    column, number = f"{scene.body[0].name}.velocity", f"joint[{scene.joint[-1].name}].anchor.x"
    found = mbref.sensitivities(scene, [column], [number], times).values
    scaled = mbref.sensitivities(in_other_units(scene, mass, length, time), [column], [number], times * time)
    assert_close(scaled.values * time, found, 1e-10)  # (m/s)/m; rounding of a mechanism of many rows


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_derivative_of_a_random_mechanism_equals_differences_of_the_judges_references(seed):
    """The mechanisms have couplings and redundant rows. The true derivative is a central difference of order
    8 of the judge's references, at masses up to 8 % apart. Allowed are 1e-8 of the largest derivative, ten
    times the default rtol of motions, and 1e-11 m/kg: the references' rounding, 1e-13 m, over the step."""
    scene, times, step = powered_mechanism(seed), np.array([0.03]), 0.02
    name = scene.body[0].name
    found = mbref.sensitivities(scene, [f"{name}.position"], [f"body[{name}].mass"], times)

    def position(factor):
        changed = scene.with_(f"body[{name}].mass", factor * scene.body[0].mass)
        return reference(changed, times, seconds=60).position[0, 0]

    parts = [weight * (position(1 + k * step) - position(1 - k * step)) for k, weight in CENTRAL]
    true = sum(parts) / (step * scene.body[0].mass)
    allowed = 1e-8 * np.abs(true).max() + 1e-11  # m/kg
    assert np.abs(found.values[0, :, 0] - true).max() <= allowed


@pytest.mark.parametrize(
    ("scene", "of", "to", "reason"),
    [
        (pendulum(), "A.open", "body[bob].mass", "no derivative"),
        (pendulum(), "A.angle", "body[bob].name", "no number at this path"),
        (pendulum(), "A.angle", "/7", "is not a path of a scene"),
        (pendulum(), "A.angle", "load[7].stiffness", r"load\[7\]\.stiffness: "),
        (pendulum(), "A.angle", "gravity.y gravity[1]", "are one number"),
        (pendulum(), "A.angle", "joint[A].displacement(0)", "no joint 'A' with this coordinate"),
        (crank_linkage(ROCKER), "B.angle", "joint[A].angle(0)", "drivers prescribe the whole motion"),
        (crank_linkage(ROCKER), "B.angle", "joint[B].axis.x", "cannot stay closed"),
    ],
    ids=["output", "text", "no field", "no load", "twice", "coordinate", "driven", "tilted hinge"],
)
def test_output_or_number_without_a_derivative_is_refused_by_name(scene, of, to, reason):
    with pytest.raises((mbref.InputError, mbref.SceneError), match=reason):
        mbref.sensitivities(scene, [of], to.split(), [0.1])


def test_derivatives_end_undecided_at_a_singular_position():
    """The parallelogram falls through its flat position between 0.05 s and 0.3 s; another branch begins
    there, so that a derivative depends on the branch."""
    found = mbref.sensitivities("four_bar_gravity", ["A.angle"], ["gravity.y"], [0.05, 0.3])
    assert found.outcome is mbref.Outcome.UNDECIDED
    assert np.isfinite(found.values[0]).all()
    assert np.isnan(found.values[1]).all()
    later = mbref.sensitivities("four_bar_gravity", ["A.angle"], ["gravity.y"], [0.3])
    assert np.isnan(later.values).all() and "singular position" in later.message


def test_command_prints_and_writes_the_derivatives_of_the_function(tmp_path, capsys):
    """The derivative of the energy (J) by the rate at the start (rad/s). The tests above show that the
    function `mbref.sensitivities` is right; here the command prints and writes its numbers and the unit."""
    path, out, of, to = tmp_path / "pendulum.toml", tmp_path / "found.csv", "energy", "joint[A].rate(0)"
    pendulum().save(path)
    request = ["--of", of, "--to", to, "--times", "0.1,0.4", "--out", str(out), "--json"]
    assert main(["sensitivities", str(path), *request]) == 0
    printed = json.loads(capsys.readouterr().out)
    found = mbref.sensitivities(path, [of], [to], [0.1, 0.4])
    assert printed["values"] == found.values.tolist()
    assert printed["units"] == [["(J)/(rad/s)"]]
    assert np.loadtxt(out, delimiter=",", skiprows=1)[:, 1].tolist() == found.get(of, to).tolist()


def test_chain_of_ten_loops_obeys_eulers_identity_of_masses_and_moments_of_inertia():
    """Energy is homogeneous of degree 1 in these numbers p of the 21 bodies: Σ p ∂E/∂p = E, Σ p ∂φ/∂p = 0."""
    scene = mbref.find_scene("four_bar_chain[10]")
    numbers = {f"body[{body.name}].mass": body.mass for body in scene.body}
    numbers |= {f"body[{body.name}].inertia.z": body.inertia[2] for body in scene.body}
    times, angle = [0.05, 0.1], f"{scene.joint[0].name}.angle"
    found = mbref.sensitivities(scene, ["kinetic_energy", angle], [*numbers], times)
    energies, angles = (found.values @ np.array([*numbers.values()])).T
    motion = mbref.simulate(scene, times=times).columns("kinetic_energy", angle)
    assert_close(energies, motion["kinetic_energy"])
    assert np.abs(angles).max() < ACCURATE * np.abs(motion[angle]).max()
