"""Every planted defect fails its check, every check has a defect, and the sound engine passes all."""

import functools
import tomllib
from pathlib import Path

import pytest

from crosscheck.conformance import suite, trial
from crosscheck.conformance.mechanisms.features import undetermined
from crosscheck.conformance.mechanisms.specimens import Specimen, specimens
from crosscheck.conformance.properties import PROPERTIES
from crosscheck.conformance.runners import InProcess
from tests.zoo.defects import DEFECTS, engine
from tests.zoo.table import FOR_REPORTS, data, page

ON_ONE_BODY = {  # check of a law and its scene
    "momenta": "tumbling body",  # momenta are constant without loads
    "passive": "pendulum",  # the energy does not grow
    "similar": "pendulum",  # a copy of 1 cm for 1 m has equal accelerations
    "distant": "pendulum",  # a copy 1 km away has equal accelerations
}
SPECIMENS = {s.scene.name: s for s in [Specimen(undetermined()), *specimens()]}


@functools.cache
def sound_bench(scene: str, has_ways: bool = False) -> trial.Bench:
    return trial.set_up(InProcess(engine(has_ways=has_ways)), SPECIMENS[scene])


@pytest.mark.parametrize("about", DEFECTS)
def test_planted_defect_fails_its_check_which_the_sound_engine_passes(about):
    """tests/zoo/defects.toml names a check and a scene for each change of one line in the example engine. The
    check fails on the scene though the faulty engine completes its run, and passes without the change."""
    defect = DEFECTS[about]
    runner = InProcess(engine(defect, defect.has_ways))
    sound = suite.verdict_on(defect.check, sound_bench(defect.scene, defect.has_ways))
    bench = suite.asked(runner, SPECIMENS[defect.scene])
    if isinstance(bench, trial.Bench):
        faulty = suite.verdict_on(defect.check, bench)
        alone = defect.check in suite.FIRST or bench.specimen.dead_end
        first = alone or suite.first_run(bench).status == suite.PASS
        assert first, f"{about}: the run does not complete, so that no check but run is asked"
    else:
        faulty = bench
    assert faulty.status == suite.FAIL, f"{about}: {defect.check} on {defect.scene} says {faulty}"
    assert faulty.property == defect.check
    assert sound.status == suite.PASS, f"the sound engine: {sound}"


@pytest.mark.parametrize(("check", "scene"), ON_ONE_BODY.items())
def test_check_of_a_law_fails_on_one_body_with_a_planted_defect_and_passes_without(check, scene):
    """The suite asks these checks on a flying ring and a whirling slider-crank. Their laws hold for one body,
    too, which costs less. The defect is the first that tests/zoo/defects.toml lists for the check."""
    defect = next(defect for defect in DEFECTS.values() if defect.check == check)
    faulty = trial.set_up(InProcess(engine(defect)), SPECIMENS[scene])
    for bench, status in ((faulty, suite.FAIL), (sound_bench(scene), suite.PASS)):
        found = suite.verdict_on(check, bench)
        assert found.status == status, found


def test_every_check_has_a_defect_that_it_detects():
    """tests/zoo/defects.toml names each check of the suite; the first test here shows the detection."""
    idle = {*suite.FIRST, *PROPERTIES} - {defect.check for defect in DEFECTS.values()}
    assert not idle, f"no defect of the zoo trips {sorted(idle)}"


@pytest.mark.slow
def test_sound_engine_passes_the_whole_suite():
    """The example engine without a defect violates no check on any mechanism."""
    found = suite.held_against(InProcess(engine()), specimens(deep=True))
    failed = [v for v in found.verdicts if v.status == suite.FAIL]
    assert found.conforms, failed


def test_page_and_data_of_checks_are_what_their_command_writes():
    """python -m tests.zoo.table writes docs/results/conformance.md and the data for reports."""
    path = Path(__file__).parents[2] / "docs" / "results" / "conformance.md"
    assert path.read_text() == page(), "python -m tests.zoo.table docs/results/conformance.md renews it"
    assert FOR_REPORTS.read_text() == data(), "the same command renews it"
    assert set(tomllib.loads(data())["defect"][0]) == {"about", "scene", "check"}
