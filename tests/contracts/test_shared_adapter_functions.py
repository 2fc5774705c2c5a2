"""Functions that adapters share: samples of a run, and the search for a compiler."""

import math

import numpy as np
import pytest

from crosscheck.engines.shared.compiler import Compiler, NoLibrary
from crosscheck.engines.shared.sampling import Counts, Failed, Sample, run_through
from mbref.motions.trajectory import Outcome
from tests.helpers.still_engines import resting


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
    found = run_through(resting(), times, advance, sampled, Counts(), 0.0, LABELS)
    assert (found.outcome, found.t_end, found.message) == (Outcome.STEP_FAILED, 0.75, "no step")
    assert found.times.tolist() == [0.0, 0.5] and found.position.shape == (2, 1, 3)
    assert found.reactions is None
    lost_at_2 = lambda t: sampled(math.nan if t > 1 else t)  # noqa: E731
    lost = run_through(resting(), times, lambda *_: None, lost_at_2, Counts(), 0.0, LABELS)
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
