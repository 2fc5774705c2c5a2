"""A few hundred cases of the fuzzers, by their seeds; ``make fuzz`` runs many more."""

import random

import pytest

from tests.fuzz import targets
from tests.fuzz.command_lines import drawn_command

LENGTHY = {"compare", "verify"}  # commands that run for minutes


@pytest.mark.parametrize(("target", "count"), [("scene_file", 80), ("scene_data", 150)])
def test_mutated_scene_is_accepted_or_refused_with_a_scene_error(target, count, tmp_path, monkeypatch):
    """Each seed changes a right scene. A defect is another error than SceneError; both endings occur."""
    monkeypatch.chdir(tmp_path)
    cases = {seed: targets.case(target, seed) for seed in range(count)}
    assert not {seed: defect for seed, (_, defect) in cases.items() if defect}
    assert len({ending for ending, _ in cases.values()}) > 1, "every case ended alike"


def test_random_command_line_ends_with_a_documented_status_and_message(tmp_path, monkeypatch):
    """28 seeds draw command lines. Documented are the statuses 0, 1, 2 and 130. A traceback, or a file
    that is left behind, is a defect. More than 10 pairs of command and status are met."""
    monkeypatch.chdir(tmp_path)
    short = [seed for seed in range(1000, 1028) if drawn_command(random.Random(seed)).name not in LENGTHY]
    cases = {seed: targets.case("command_line", seed) for seed in short}
    assert not {seed: defect for seed, (_, defect) in cases.items() if defect}
    assert len({ending for ending, _ in cases.values()}) > 10, "few commands were tried"


def test_undocumented_error_is_reported_as_a_defect_with_its_place(monkeypatch):
    """`diagnose` of a number raises SceneError, which is undocumented for this made-up target."""
    monkeypatch.setitem(targets.TARGETS, "faulty", lambda seed: str(targets.diagnose(seed)))
    defect = targets.case("faulty", 7)[1]
    assert "SceneError" in defect and "diagnosis.py" in defect, defect
