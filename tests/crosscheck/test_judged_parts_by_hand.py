"""A reference as a trajectory, mass matrix, weight, mean steps, the processor / worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from crosscheck.convergence import document
from crosscheck.judge import gauss_principle, reaction_balance
from crosscheck.judge.truth.reference_truth import trajectory
from crosscheck.setting import Setting
from crosscheck.study import fair_timing, origin
from mbref.scene import Body, Revolute, Scene

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
