"""Drivers of planar joints, in the plane and about its normal, and of a ball joint's orientation: motions,
forces, powers, files and faults. The anchor of a block of 2 kg is at the origin."""

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.spatial.transform import Rotation

import crosscheck
import mbref
from crosscheck.conformance.changes.copies import replaced
from crosscheck.judge.reference.reference import reference
from mbref import Scene, SceneError
from mbref.cli.commands import main
from tests.helpers.parts import joint
from tests.helpers.short_motions import SKEW, arm_with
from tests.helpers.statics import DOWN

MASS, MOMENTS, ARM, Z = 2.0, (0.02, 0.03, 0.04), np.array([0.1, 0.05, 0.02]), [0.0, 0.0, 1.0]
R, W, TIMES, ORIGIN = 0.3, 2.0, np.linspace(0.0, 1.5, 16), (0.0, 0.0, 0.0)
BLOCK = {"name": "block", "mass": MASS, "inertia": MOMENTS, "position": ARM.tolist()}
WAVE = {"polynomial": [0.0, 0.5], "sine": {"amplitude": 0.4, "frequency": 3.0}}
CIRCLE = (
    {"name": "x", "joint": "P", "along": [1.0, 0.0, 0.0], "polynomial": [-R]}
    | {"sine": {"amplitude": R, "frequency": W, "phase": "90 deg"}},
    {"name": "y", "joint": "P", "along": [0.0, 2.0, 0.0], "sine": {"amplitude": R, "frequency": W}},
)
ROWS, SHORT = ((0.0, 0.0), (0.1, 0.05), (0.2, -0.02), (0.3, 0.1)), np.linspace(0.0, 0.3, 4)
TURNS = (
    {"axis": Z, **WAVE},
    {"axis": [1.0, 0.0, 0.0], "sine": {"amplitude": 0.5, "frequency": 3.0}},
    {"axis": [0.0, 0.6, 0.8], "polynomial": [0.0, -1.0, "40 deg/s^2"]},
)
BALL, S, C, SQUARE = {"joint": "S", "turn": TURNS}, np.sin(3 * TIMES), np.cos(3 * TIMES), np.deg2rad(40)
LAWS = (  # angles of the turns, and two derivatives
    (TIMES / 2 + 0.4 * S, 0.5 + 1.2 * C, -3.6 * S),
    (0.5 * S, 1.5 * C, -4.5 * S),
    (SQUARE * TIMES**2 - TIMES, 2 * SQUARE * TIMES - 1, 2 * SQUARE + 0 * TIMES),
)
METHODS = ("taylor", "lm1+projection", "alf-dual+projection", "mpi-svd+partitioning")


def plate(*drivers: dict, kind="planar", name="P") -> Scene:
    """Return a block on a planar joint with the ground, of normal z, or on another joint, with drivers."""
    held = joint(name, kind, "ground", "block", ORIGIN, **({"axis": Z} if kind == "planar" else {}))
    return Scene(name="plate", gravity=DOWN, duration=1.5, body=[BLOCK], joint=[held], driver=drivers)


def carried(kind: str, *drivers: dict) -> Scene:
    """Return a block on an arm that swings on a skew hinge, at rest at first, with drivers of its joint B."""
    bodies = [replaced(body, velocity=None, angular_velocity=None) for body in arm_with(kind).body]
    return arm_with(kind).with_(body=bodies, driver=[{**driver, "joint": "B"} for driver in drivers])


def newton_euler(count, of_anchor):
    """Return arm c, ω, force and moment (k, 3) on the block at its anchor, whose acceleration is
    given. With R = R₁ R₂ R₃, ω = Σ qₖ' aₖ and ω' = Σ (qₖ'' aₖ + ω × qₖ' aₖ) with the carried axes aₖ and the
    part of ω before; F = m (c'' - g) and M = J ω' + ω × J ω + c × F."""
    turned, omega, second = Rotation.identity(len(TIMES)), np.zeros((len(TIMES), 3)), 0.0
    for turn, law in zip(TURNS[:count], LAWS, strict=False):
        q, rate, bend = (each[:, None] for each in law)
        axis = turned.apply(turn["axis"])
        second = second + bend * axis + rate * np.cross(omega, axis)
        omega = omega + rate * axis
        turned = turned * Rotation.from_rotvec(q * turn["axis"])
    arm, matrix = turned.apply(ARM), turned.as_matrix()
    of_centre = of_anchor + np.cross(second, arm) + np.cross(omega, np.cross(omega, arm))
    force, inertia = MASS * (of_centre - np.array(DOWN)), matrix @ np.diag(MOMENTS) @ matrix.swapaxes(1, 2)
    own, spin = (np.einsum("kij,kj->ki", inertia, each) for each in (second, omega))
    return arm, omega, force, own + np.cross(omega, spin) + np.cross(arm, force)


@pytest.mark.parametrize("method", METHODS)
def test_block_on_a_circle_that_turns_needs_the_forces_of_newton_and_euler(method):
    """The anchor moves on a circle of 0.3 m, the block turns about z."""
    place = R * np.stack([np.cos(W * TIMES), np.sin(W * TIMES), 0 * TIMES], 1)
    arm, _, force, moment = newton_euler(1, -(W**2) * place)
    motion = mbref.simulate(plate({"joint": "P", **WAVE}, *CIRCLE), method, TIMES, rtol=1e-12)
    close = 1e-12 * np.abs(force).max()
    assert np.abs(motion["block"].position - place + [R, 0, 0] - arm).max() < 1e-12
    assert np.abs(motion.driver("x").force - force[:, 0]).max() < close
    assert np.abs(motion.driver("y").power - force[:, 1] * W * place[:, 0]).max() < close
    assert np.abs(motion.driver("P").torque - moment[:, 2]).max() < close


@pytest.mark.parametrize("method", METHODS[1:])
def test_body_with_given_orientation_needs_the_rate_of_its_angular_momentum(method):
    _, omega, _, moment = newton_euler(3, np.zeros(3))
    motion = mbref.simulate(plate(BALL, kind="spherical", name="S"), method, TIMES, rtol=1e-12)
    assert np.abs(motion["block"].angular_velocity - omega).max() < 1e-12
    assert np.abs(motion.driver("S").moment - moment).max() < 1e-12 * np.abs(moment).max()
    assert np.abs(motion.driver("S").power - np.sum(moment * omega, axis=1)).max() < 1e-11


def test_motion_with_driven_orientation_goes_on_from_a_sample_and_from_a_file(tmp_path):
    carried("spherical", BALL).save(tmp_path / "arm.toml")
    motion = mbref.simulate(Scene.from_file(tmp_path / "arm.toml"), times=SHORT)
    rest = mbref.simulate(motion.scene_at(0.1), times=SHORT[:-1])
    assert np.abs(rest.driver("B").moment - motion.driver("B").moment[1:]).max() < 1e-9


@pytest.mark.parametrize("command", ["run {} --method taylor", "modes {}"])
def test_commands_and_engines_without_driven_orientations_name_the_joint(command, tmp_path, capsys):
    scene = plate(BALL, kind="spherical", name="S")
    scene.save(tmp_path / "ball.toml")
    assert main(command.format(tmp_path / "ball.toml").split()) == 2
    assert "driver[S].turn" in capsys.readouterr().err
    assert "joint 'S' prescribes its orientation" in str(crosscheck.find_engine("mujoco").cannot(scene))


@pytest.mark.parametrize(
    "scene",
    [
        carried("spherical", BALL),
        carried("planar", {"table": ROWS}, {"name": "x", "along": np.cross(SKEW, Z).tolist(), "table": ROWS}),
    ],
)
def test_driven_joint_on_a_swinging_arm_moves_as_the_references_and_balances_power(scene):
    """The judge's two formulations, its residuals and its inverse dynamics know the drivers."""
    exact, times = reference(scene, SHORT), np.linspace(0.0, 0.3, 601)
    assert exact.bound.max() < 1e-12 and exact.both.all()
    motion = mbref.simulate(scene, times=SHORT, rtol=1e-12)
    errors = crosscheck.measure(scene, motion, crosscheck.truth_for(scene))
    kinds = "error", "violation_position", "violation_acceleration", "reaction_error"
    assert all(not errors[kind] > 1e-9 for kind in kinds), errors
    table, columns = crosscheck.reference_table(scene, SHORT), motion.columns()
    for name in (name for name in table if name.startswith("driver")):
        assert np.abs(columns[name] - table[name]).max() < 1e-9 * np.abs(table[name]).max(), name
    columns = mbref.simulate(scene, times=times).columns()
    power = sum(values for name, values in columns.items() if name.endswith(").power"))
    assert simpson(power, x=times) == pytest.approx(np.diff(columns["energy"][[0, -1]])[0], rel=1e-6)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"along": [0, 0.1, 1]}, "driver[y].along: must lie in the plane of joint 'P', perpendicular to"),
        ({"name": None}, "driver[P].joint: with along needs name, too, for a displacement of the joint"),
        ({"turn": TURNS}, "driver[y].turn: prescribes the whole orientation; sine belongs into its entries"),
        (None, "driver[S].joint: 'S' is spherical; its driver has one to three entries [[driver.turn]]"),
        ([{**TURNS[0], "polynomial": [0, "1 mm"]}], "driver[S].turn[0].polynomial[1]: prescribes the angle"),
        ([*TURNS, TURNS[0]], "driver[S].turn: must be one to three entries [[driver.turn]], each with"),
    ],
)
def test_faulty_driver_of_a_plane_or_a_ball_is_refused_with_its_field(change, fault):
    with pytest.raises(SceneError) as refusal:
        if isinstance(change, dict):
            plate({**CIRCLE[1], **change})
        plate({"joint": "S", "turn": change or ()}, kind="spherical", name="S")
    assert any(each.startswith(fault) for each in refusal.value.faults), refusal.value.faults
