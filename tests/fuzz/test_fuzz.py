"""A few hundred cases of the fuzzers, by their seeds; ``make fuzz`` runs many more."""

import pytest

from tests.fuzz import targets

SHORT = range(1000, 1060)  # seeds


@pytest.mark.parametrize(("target", "count"), [("scene_file", 150), ("scene_data", 300)])
def test_mutated_scene_is_accepted_or_refused_with_a_scene_error(target, count, tmp_path, monkeypatch):
    """A case is a seed, how it ended, and its defect, empty unless another error was raised."""
    monkeypatch.chdir(tmp_path)
    endings = [(seed, *targets.case(target, seed)) for seed in range(count)]
    assert not [case for case in endings if case[2]]
    assert len({ending for _, ending, _ in endings}) > 1, "every case ended alike"


def test_random_command_line_ends_with_a_documented_status_and_message(tmp_path, monkeypatch):
    """Status 0, 1, 2 or 130, no traceback, and no file that the command line does not name."""
    monkeypatch.chdir(tmp_path)
    endings = [(seed, *targets.case("command_line", seed)) for seed in SHORT]
    assert not [case for case in endings if case[2]]
    assert len({ending for _, ending, _ in endings}) > 10, "few commands were tried"


def test_undocumented_error_is_reported_as_a_defect_with_its_place(monkeypatch):
    monkeypatch.setitem(targets.TARGETS, "faulty", lambda seed: str(targets.diagnose(seed)))
    defect = targets.case("faulty", 7)[1]
    assert "SceneError" in defect and "diagnosis.py" in defect, defect
