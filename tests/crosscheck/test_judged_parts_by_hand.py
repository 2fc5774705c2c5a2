"""A reference as a trajectory, mass matrix, weight, mean steps, the processor / worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from crosscheck.conformance import relations
from crosscheck.convergence import document
from crosscheck.engines import terms
from crosscheck.engines.mujoco.importing import agreement
from crosscheck.engines.sampling import Failed
from crosscheck.judge import gauss_principle, metrics, reaction_balance
from crosscheck.judge.truth.reference_truth import trajectory
from crosscheck.judge.truth.spatial_slider_crank import spatial_slider_crank
from crosscheck.processes import interrupts
from crosscheck.setting import Setting
from crosscheck.study import fair_timing, origin
from mbref.scene import Body, Revolute, Scene, Spherical, Universal
from mbref.scenes import find_scene
from mbref.trajectory import Outcome, Trajectory

LINK = Body(name="link", mass=2.0, inertia=(1.0, 3.0, 3.5), position=(1.0, 0.0, 0.0))


def scene(*bodies: Body) -> Scene:
    hinge = Revolute(name="A", bodies=("ground", "link"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    return Scene(name="s", duration=1.0, gravity=(0.0, -10.0, 0.0), body=bodies, joint=(hinge,))


def samples(times: list[float]) -> SimpleNamespace:
    """Fields of a reference, each with other numbers; the bound is largest at the second sample."""
    n = len(times)
    names = ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
    fields = {name: np.full((n, 1, 3), 1.0 + k) for k, name in enumerate(names)}
    fields["orientation"] = np.tile([0.6, 0.8, 0.0, 0.0], (n, 1, 1))
    return SimpleNamespace(times=np.array(times), bound=np.array([1e-9, 3e-9, 2e-9][:n]), **fields)


def test_a_reference_as_a_trajectory():
    given = samples([0.0, 0.25, 0.5])
    found = trajectory(scene(LINK), given)
    assert (found.scene, found.engine, found.method, found.bodies) == ("s", "truth", "reference", ("link",))
    assert found.settings == {"bound": 3e-9} and found.t_end == 0.5
    for name in ("position", "orientation", "velocity", "angular_velocity", "acceleration"):
        assert getattr(found, name) is getattr(given, name), name
    assert found.angular_acceleration is given.angular_acceleration


def test_a_reference_without_samples():
    found = trajectory(scene(LINK), samples([]))
    assert found.settings == {"bound": 0.0} and found.t_end == 0.0


def test_the_mass_matrix_and_the_forces_without_constraints():
    """The link of 2 kg has the moments 1, 3 and 3.5 kg m²; only its weight acts."""
    mass, force = gauss_principle._unbound(scene(LINK))
    assert mass.tolist() == np.diag([2.0, 2.0, 2.0, 1.0, 3.0, 3.5]).tolist()
    assert force == pytest.approx([0.0, -20.0, *[0.0] * 4])


# --- small parts of judges and studies --------------------------------------------------------------------
@pytest.mark.parametrize(
    ("options", "steps", "expected"), [({"step": 0.125}, 4, 0.125), ({}, 4, 0.25), ({}, 1, 1.0), ({}, 0, 1.0)]
)
def test_the_step_of_a_run_or_its_mean_step(options, steps, expected):
    record = {"asked": {"options": options}, "t_end": 1.0, "cost": {"steps": steps}}
    assert document.step(record) == expected


def test_bodies_without_mass_add_nothing_to_the_scale_of_reactions():
    """A force of 1e-3 N is smaller than the least share of 2 kg; 50 N is larger."""
    both = scene(LINK, Body(name="bare", position=(2.0, 0.0, 0.0)))
    assert reaction_balance._scale(both, np.zeros(6)) == reaction_balance.LEAST * 2.0
    assert reaction_balance._scale(both, np.array([0.0, -50.0])) == 50.0


def test_short_runs_are_of_families_that_python_calls():
    own, compiled = Setting("stock", {}), Setting("stock, compiled", {})
    assert fair_timing._called_from_python([own, compiled]) == [own]
    assert fair_timing._called_from_python([compiled]) == [compiled], "an engine with compiled families alone"


def test_the_name_of_the_processor(monkeypatch, tmp_path):
    """The first model of Linux' list; without the list, the name that Python finds."""
    listed = tmp_path / "cpuinfo"
    listed.write_text("flags: a\nmodel name : Fast: 9\nmodel name : Slow\n")
    monkeypatch.setattr(origin, "Path", lambda _: listed)
    monkeypatch.setattr(origin.platform, "processor", lambda: "x86")
    assert origin._processor() == "Fast: 9"
    listed.write_text("flags: a\n")
    assert origin._processor() == "x86"
    listed.unlink()
    assert origin._processor() == "x86"
    monkeypatch.setattr(origin.platform, "processor", lambda: "")
    monkeypatch.setattr(origin.platform, "machine", lambda: "riscv")
    assert origin._processor() == "riscv"


@pytest.mark.parametrize(("extent", "least"), [(0.25, 0.25), (3.0, 1.0)])
def test_rows_of_loops_count_from_a_length(extent, least, monkeypatch):
    """The least row that counts is RANK above 1 m, and in proportion to the length below."""
    seen = []
    monkeypatch.setattr(agreement, "_unit", lambda rows, least: seen.append(least) or rows)
    empty = np.zeros((0, 6))
    poses = SimpleNamespace(extent=extent, jacobian=lambda: empty)
    compared = SimpleNamespace(_equalities=lambda: empty, poses=poses)
    pose = np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    agreement.Agreement._loops(compared, scene(LINK).with_(joint=()), (), pose, np.eye(6))
    assert seen == [agreement.RANK * least] * 2


@pytest.mark.parametrize("size", [math.nan, math.inf])
def test_terms_that_are_not_finite_end_a_run(size):
    simulation = SimpleNamespace(free=np.array([1]))
    with pytest.raises(Failed, match=r"the closures are not finite at 0\.5 s$") as caught:
        terms.Simulation._spread(simulation, 0.5, np.eye(1), np.array([[0.0, size]]))
    assert (caught.value.outcome, caught.value.t) == (Outcome.NOT_FINITE, 0.5)
    with pytest.raises(Failed, match=r"the state is not finite at 0\.25 s$") as caught:
        terms.Simulation._root(simulation, 0.25, SimpleNamespace(mass=np.diag([1.0, size])))
    assert (caught.value.outcome, caught.value.t) == (Outcome.NOT_FINITE, 0.25)
    spread = terms.Simulation._spread(simulation, 0.5, 2.0 * np.eye(1), np.array([[9.0, 3.0]]))
    assert spread.tolist() == [[1.5]], "the column of the free coordinate, over the root"


def test_an_isometry_without_a_shift_keeps_the_origin():
    changed = relations._isometry("nothing", np.eye(3)).change(scene(LINK), None)
    assert changed.body[0].position == (1.0, 0.0, 0.0) and changed.joint[0].anchor == (0.0, 0.0, 0.0)
    changed = relations._isometry("a shift", np.eye(3), (1.0, 2.0, 3.0)).change(scene(LINK), None)
    assert changed.body[0].position == (2.0, 2.0, 3.0) and changed.joint[0].anchor == (1.0, 2.0, 3.0)


def test_attempts_to_end_calls_are_a_tenth_of_a_second_apart(monkeypatch):
    """The second attempt ends the last child."""
    left, asked = [["call"], ["call"], []], []
    monkeypatch.setattr(interrupts, "stop_all", lambda: asked.append("stop"))

    def wait(calls: object, timeout: float) -> SimpleNamespace:
        asked.append(timeout)
        return SimpleNamespace(not_done=left.pop(0))

    monkeypatch.setattr(interrupts, "wait", wait)
    with pytest.raises(KeyboardInterrupt), interrupts.calls_ended([]):
        raise KeyboardInterrupt
    assert asked == [0.1, "stop", 0.1, "stop", 0.1]


@pytest.mark.parametrize(("true", "found", "expected"), [(0.5, 0.6, 0.2), (0.5, 0.5, 0.0), (0.0, 0.1, None)])
def test_errors_of_velocities_count_from_the_largest_true_velocity(true, found, expected):
    """A link moves along x, slower than 1 m/s; without true motion there is no scale."""

    def motion(speed: float) -> Trajectory:
        given = samples([0.0, 0.25])
        fields = {"velocity": np.tile([speed, 0.0, 0.0], (2, 1, 1)), "angular_velocity": np.zeros((2, 1, 3))}
        return trajectory(scene(LINK), SimpleNamespace(**{**vars(given), **fields}))

    got = metrics._velocity_error(scene(LINK), motion(found), motion(true))
    assert got is None if expected is None else got == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("which", [0, 1])
def test_no_path_where_an_axis_of_the_universal_joint_is_along_the_rod(which):
    """The spatial slider-crank of the paper, but one axis of the joint between crank and rod."""
    given = find_scene("spatial_slider_crank")
    [pin] = [joint for joint in given.joint if isinstance(joint, Universal)]
    assert spatial_slider_crank(given) is not None
    end = next(joint for joint in given.joint if isinstance(joint, Spherical))
    along = np.array(end.anchor) - np.array(pin.anchor)
    across = np.cross(along, [0.3, 0.2, 0.9])
    axes = [tuple(each / np.linalg.norm(each)) for each in (along, across)]
    turned = pin.model_copy(update={"axes": tuple(axes[:: 1 - 2 * which])})
    joints = [turned if joint is pin else joint for joint in given.joint]
    assert spatial_slider_crank(given.model_copy(update={"joint": tuple(joints)})) is None
