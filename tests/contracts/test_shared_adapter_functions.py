"""Functions that adapters share: refusals of loads, samples of a run, and the search for a compiler."""

import math

import numpy as np
import pytest

from crosscheck.engines.shared.compiler import Compiler, NoLibrary
from crosscheck.engines.shared.fixed_steps import unended_piece
from crosscheck.engines.shared.sampling import Counts, Failed, Sample, run_through
from crosscheck.refusals import Owner
from mbref.motions.trajectory import Outcome
from mbref.scene import Body, Factor, Force, Moment, Revolute, Scene, Sine
from tests.helpers.parts import X, Z

HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))


def scene(*loads: Moment | Force) -> Scene:
    """Return a body on a hinge for 2 s."""
    body = Body(name="b", mass=4.0, inertia=(1.0, 2.0, 3.0), position=(1.0, 2.0, 3.0))
    return Scene(name="s", body=(body,), joint=(HINGE,), duration=2.0, load=loads)


def test_switched_and_tabulated_loads_are_refused_for_steps_that_cannot_end_there():
    """A step has to end where a factor over time is switched on or passes a point of its table, at 0.5 s or 1
    s of the 2 s; a factor with a sine is smooth and needs no end of a step."""
    table = Factor(table=((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 4.0)))
    smooth = Moment(body="b", moment=Z, factor=Factor(sine=Sine(amplitude=1.0)))
    switched = Force(body="b", point=X, force=Z, factor=Factor(start=0.5))
    assert unended_piece(scene(smooth, Moment(body="b", moment=Z))) is None
    for load in (switched, Moment(body="b", moment=Z, factor=table)):
        found = unended_piece(scene(smooth, load))
        assert found.owner is Owner.ADAPTER
        assert found.reason.startswith("load[1] follows a table or is switched")


def sampled(t: float) -> Sample:
    """Return a sample of a body at (t, t, t) m whose rates are zero."""
    rates = ("velocity", "angular_velocity", "acceleration", "angular_acceleration")
    zeros = {name: np.zeros((1, 3)) for name in rates}
    return Sample(position=np.full((1, 3), t), orientation=np.array([[1.0, 0, 0, 0]]), **zeros)


LABELS = {"engine": "e", "version": "1", "method": "m", "settings": {}}


def test_run_that_fails_keeps_its_samples_and_states_the_reason():
    """Samples are wanted at 0, 0.5 and 2 s. One run fails at 0.75 s by its step; another has no finite
    position at 2 s. Both keep the two samples before."""

    def advance(t0: float, t1: float) -> None:
        if t1 > 1.0:
            raise Failed(Outcome.STEP_FAILED, 0.75, "no step")

    times = np.array([0.0, 0.5, 2.0])
    found = run_through(scene(), times, advance, sampled, Counts(), 0.0, LABELS)
    assert (found.outcome, found.t_end, found.message) == (Outcome.STEP_FAILED, 0.75, "no step")
    assert found.times.tolist() == [0.0, 0.5] and found.position.shape == (2, 1, 3)
    assert found.reactions is None
    lost_at_2 = lambda t: sampled(math.nan if t > 1 else t)  # noqa: E731
    lost = run_through(scene(), times, lambda *_: None, lost_at_2, Counts(), 0.0, LABELS)
    assert (lost.outcome, lost.t_end, len(lost.times)) == (Outcome.NOT_FINITE, 0.5, 2)
    assert lost.message == "the motion is not finite at 2 s"


def test_compiler_is_the_environment_variable_s_or_the_first_installed(monkeypatch):
    """Only the program "two" is installed, not "one". An empty variable CC counts as none."""
    compiler = Compiler("C", "CC", ("one", "two"))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None if name == "one" else f"/bin/{name}")
    assert compiler.path() == "/bin/two"
    monkeypatch.setenv("CC", "mine")
    assert compiler.path() == "/bin/mine"
    monkeypatch.setenv("CC", "one")
    with pytest.raises(NoLibrary, match=r"no C compiler is installed \(one\)"):
        compiler.path()
    monkeypatch.setenv("CC", "")
    assert compiler.path() == "/bin/two"


def test_compiler_that_cannot_be_started_is_reported():
    """The program does not exist; the error says which compiler could not be run."""
    with pytest.raises(NoLibrary, match="the C compiler could not be run"):
        Compiler("C", "CC", ()).run(["/nowhere/compiler"])
