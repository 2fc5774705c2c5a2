"""A few hundred of the fuzzers' cases; ``make fuzz`` runs the many."""

import pytest

from tests.fuzz import targets

SHORT = range(1000, 1060)  # seeds


@pytest.mark.parametrize(("target", "count"), [("scene_file", 150), ("scene_data", 300)])
def test_mutated_scenes_are_scenes_or_documented_errors(target, count, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    endings = [(seed, *targets.case(target, seed)) for seed in range(count)]
    assert not [case for case in endings if case[2]]
    assert len({ending for _, ending, _ in endings}) > 1, "every case ended alike"


def test_random_command_lines_end_as_documented(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    endings = [(seed, *targets.case("command_line", seed)) for seed in SHORT]
    assert not [case for case in endings if case[2]]
    assert len({ending for _, ending, _ in endings}) > 10, "few commands were tried"


def test_an_undocumented_error_is_a_defect(monkeypatch):
    monkeypatch.setitem(targets.TARGETS, "faulty", lambda seed: str(targets.diagnose(seed)))
    defect = targets.case("faulty", 7)[1]
    assert "SceneError" in defect and "diagnosis.py" in defect, defect
