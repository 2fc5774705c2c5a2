"""Springs of no natural length whose ends meet in a pose: closed forms, and refusals where a damper acts."""

import numpy as np
import pytest

import mbref
from crosscheck.derivatives.compare import rows
from crosscheck.engine import engine, installed
from crosscheck.judge.reference.reference import NoReference, reference
from crosscheck.judge.small_motions.equilibria import steady_poses
from mbref.scene import Scene, SceneError
from tests.helpers.parts import joint, slide, spring

MASS, STIFFNESS, DAMPING, FALL = 2.0, 3.0, 0.5, -2.0  # kg, N/m, N s/m, m/s²
VELOCITY = (1.0, 0.5, 0.0)
AT_THE_PIN = (0.0, 0.0, 0.0)
RATE = np.sqrt(STIFFNESS / MASS)
NUMBERS = ["load[0].stiffness", "load[0].damping", "body[block].mass"]


def tied(kind: str, damping: float, moving: bool = False) -> Scene:
    """Return a block on a slide along x, or on the plane z = 0, that a spring ties to the place where it is;
    if it is moving, it falls, too."""
    block = {"name": "block", "mass": MASS, "inertia": [1.0, 1.0, 1.0], "position": AT_THE_PIN}
    if moving:
        block["velocity"] = VELOCITY if kind == "plane" else (1.0, 0.0, 0.0)
    guide = slide("S", "ground", "block", AT_THE_PIN)
    if kind != "slide":
        guide = joint("P", "planar", "ground", "block", axis=[0.0, 0.0, 1.0])
    load = spring("ground", AT_THE_PIN, "block", AT_THE_PIN, STIFFNESS, 0.0, damping)
    fall = (0.0, FALL, 0.0) if moving else AT_THE_PIN
    return Scene(name="tied", gravity=fall, duration=1.0, body=[block], joint=[guide], load=[load])


def swing(times: np.ndarray) -> np.ndarray:
    """Return the positions (k, 2) of the moving block on the plane without a damper, from x'' = g - k/m x."""
    rest = np.array([0.0, FALL / RATE**2])
    v = np.array(VELOCITY[:2])
    turned = RATE * np.asarray(times)[:, None]
    return rest - rest * np.cos(turned) + v / RATE * np.sin(turned)


def test_block_on_a_slide_has_the_derivatives_of_a_damped_oscillator():
    """With x'' = -(k x + c x') / m and x = x' = 0, x'' depends on x by -k/m and on x' by -c/m. Eigenvalues
    are roots of m s² + c s + k, so ds = -(dk + s dc + s² dm) / (2 m s + c)."""
    scene = tied("slide", DAMPING)
    found = mbref.state_derivatives(scene, of=["block.acceleration.x"])
    unit = found.basis[0, 0]
    assert found.by_position[0, 0] == pytest.approx(-STIFFNESS / MASS * unit, rel=1e-12)
    assert found.by_velocity[0, 0] == pytest.approx(-DAMPING / MASS * unit, rel=1e-12)
    slopes = mbref.eigenvalue_sensitivities(scene, NUMBERS)
    s = np.roots([MASS, DAMPING, STIFFNESS])
    s = s[np.argsort(-s.imag)]
    assert np.allclose(slopes.eigenvalues, s, rtol=1e-12, atol=0)
    exact = -np.array([1 + 0 * s, s, s**2]).T / (2 * MASS * s + DAMPING)[:, None]
    assert np.allclose(slopes.values, exact, rtol=1e-10, atol=0)


@pytest.mark.parametrize("kind", ["slide", "plane"])
def test_small_motions_about_the_pin_are_those_of_the_spring(kind):
    """s = ± i √(k/m) along each freedom, by mbref and by the judge; on a plane the block turns freely."""
    frequencies = mbref.equilibria(tied(kind, 0.0), starts=1)[0].frequencies
    assert np.allclose(frequencies, RATE / (2 * np.pi), rtol=1e-11, atol=0)
    judged = steady_poses(tied(kind, 0.0), starts=1)[0].eigenvalues
    assert np.allclose(np.abs(judged[np.abs(judged) > RATE / 2]), RATE, rtol=1e-11, atol=0)


@pytest.mark.parametrize(
    "question",
    [mbref.equilibria, mbref.state_derivatives, lambda scene: steady_poses(scene, starts=1)],
    ids=["equilibria", "derivatives", "judge"],
)
def test_damper_in_the_plane_has_no_direction_at_the_pin_so_that_nothing_is_linear_there(question):
    """A block that circles about the pin is not damped, one that passes it is: nothing linear has both."""
    with pytest.raises(SceneError, match=r"load\[0\]: the ends of the (damped )?spring meet"):
        question(tied("plane", DAMPING))


def test_derivative_by_a_point_is_refused_where_it_turns_the_damping_force():
    """A point of the spring that moves sideways turns the line of the ends by a right angle at once."""
    scene = tied("slide", DAMPING, moving=True)
    with pytest.raises(SceneError, match=r"load\[0\].*derivatives do not exist"):
        mbref.state_derivatives(scene, of=["block.acceleration.x"], to=["load[0].points[0].y"])


def test_reference_passes_the_pin_by_the_closed_form_and_refuses_a_damper_there():
    """The block leaves the pin on the plane as an oscillator (``swing``), to 1e-13 m."""
    times = np.array([0.0, 0.4, 1.0])
    found = reference(tied("plane", 0.0, moving=True), times)
    assert np.allclose(found.position[:, 0, :2], swing(times), rtol=0.0, atol=1e-13)
    refused = reference(tied("plane", DAMPING, moving=True), times)
    assert isinstance(refused, NoReference)
    assert "load[0] meet" in refused.reason


@pytest.mark.parametrize("name", ["mbref", "mujoco", "pinocchio", "exudyn", "sundials", "simbody"])
def test_engine_moves_the_block_from_the_pin_by_the_closed_form_or_refuses_it(name):
    """The closed form is ``swing``; the largest error is 2e-8 m, by SUNDIALS. Simbody refuses the spring."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    found, scene, times = engine(name), tied("plane", 0.0, moving=True), np.array([0.0, 0.5, 1.0])
    if reason := found.cannot(scene):
        assert name == "simbody"
        assert "load[0]" in str(reason)
        return
    best = found.settings(scene)[-1]
    run = found.run(scene, times, best)
    assert run.outcome.name == "COMPLETED"
    assert np.allclose(run.position[:, 0, :2], swing(times), rtol=0.0, atol=1e-6)  # m


def test_engine_is_right_where_all_derivatives_by_velocity_vanish():
    """Without a damper the acceleration -k/m x does not depend on the velocity. An error of this zero is
    relative to the rate √(k/m), which the derivative by position gives."""
    graded = [row for row in rows(engine("mujoco"), tied("slide", 0.0)) if row.by != "force"]
    assert {row.by for row in graded} == {"position", "velocity"}
    assert {row.grade for row in graded} == {"right"}
