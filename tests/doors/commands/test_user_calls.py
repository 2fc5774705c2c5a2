"""Calls as users write them: names of files, durations and tolerances."""

import numpy as np
import pytest

import mbref
from mbref.input_error import InputError
from mbref.scenes import SCENES

PENDULUM = SCENES["point_pendulum"]().with_(duration=0.2)


@pytest.fixture
def saved(tmp_path) -> str:
    PENDULUM.save(tmp_path / "pendulum.toml")
    return str(tmp_path / "pendulum.toml")


def test_diagnosis_takes_a_file_s_name_a_built_in_name_or_a_scene(saved):
    """The file has the pendulum; a name of neither a file nor a built-in scene is refused."""
    assert mbref.diagnose(saved) == mbref.diagnose(PENDULUM) == mbref.diagnose(PENDULUM.with_())
    assert mbref.diagnose("four_bar").counts == mbref.diagnose(SCENES["four_bar"]()).counts
    with pytest.raises(mbref.SceneError, match="unknown scene 'no_such_scene'"):
        mbref.diagnose("no_such_scene")


def test_duration_gives_a_run_101_samples_up_to_its_end(saved):
    """The run equals one at 101 equidistant times."""
    run = mbref.simulate(saved, "lm1+none", duration=0.1)
    assert run.times[-1] == 0.1 and len(run.times) == 101, run.times
    given = mbref.simulate(saved, "lm1+none", np.linspace(0.0, 0.1, 101))
    assert np.array_equal(run.position, given.position)


def test_argument_rtol_of_simulate_equals_rtol_of_limits(saved):
    """A tolerance of 1e-10 takes more steps than 1e-3; both ways of giving it lead to equal bits."""
    loose, fine = (mbref.simulate(saved, "lm1+none", [2.0], rtol=rtol) for rtol in (1e-3, 1e-10))
    assert fine.cost.steps > loose.cost.steps, "the tolerance was not taken"
    same = mbref.simulate(saved, "lm1+none", [2.0], mbref.Limits(rtol=1e-10))
    assert np.array_equal(same.position, fine.position)


def test_duration_together_with_sample_times_is_refused(saved):
    """The duration would be 0.2 s, the only sample time is 0.1 s."""
    with pytest.raises(ValueError, match="give sample times or a duration, not both"):
        mbref.simulate(saved, "lm1+none", [0.1], duration=0.2)


def test_motion_is_saved_as_json_only(saved, tmp_path):
    """The suffix may have capitals; with another one no file is written."""
    run = mbref.simulate(saved, "lm1+none", duration=0.05)
    with pytest.raises(ValueError, match=r"run.mp4: a motion is saved as .json"):
        run.save(tmp_path / "run.mp4")
    assert not (tmp_path / "run.mp4").exists()
    run.save(tmp_path / "run.JSON")
    assert (tmp_path / "run.JSON").exists()


@pytest.mark.parametrize(
    ("times", "says"),
    [
        ([], "needs at least one sample time"),
        ([[0.0, 0.1]], "needs at least one sample time"),
        ([0.1, 0.1], "must be finite, not negative and increasing"),
        ([0.2, 0.1], "must be finite, not negative and increasing"),
        ([-0.1, 0.1], "must be finite, not negative and increasing"),
        ([0.0, float("nan")], "must be finite, not negative and increasing"),
        (["soon"], "must be numbers"),
        ([10**400], "must be numbers"),
        ([[0.0], [1.0, 2.0]], "must be numbers"),
    ],
)
def test_times_of_simulate_that_are_no_samples_are_refused(times, says):
    """Refused are no time, lists of lists, equal, falling, negative and undefined times (NaN), texts, and a
    number that no float can hold."""
    with pytest.raises(InputError, match=f"^times: {says}$"):
        mbref.simulate("four_bar", times=times)
