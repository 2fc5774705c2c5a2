"""Two drivers of one freedom are named if their motions differ, and run if they agree."""

from __future__ import annotations

import numpy as np
import pytest

from mbref import Scene, SceneError, diagnose, equilibria, simulate
from mbref.cli.commands import main
from tests.helpers.statics import parallelogram, rod, slide

COMMANDS = ("run", "diagnose", "equilibrium")


def twice_driven(first, second) -> Scene:
    """A block on two slides along x, each with a driver."""
    joints = [slide(name, "block", (0.3, 0.0, 0.0), (1.0, 0.0, 0.0)) for name in ("left", "right")]
    drivers = [
        {"joint": name, "polynomial": list(motion)}
        for name, motion in zip(("left", "right"), (first, second), strict=True)
    ]
    return Scene(name="twice", body=[rod("block", (0.0, 0.0, 0.0))], joint=joints, driver=drivers)


@pytest.mark.parametrize("share", [1e-3, 1e-8])
@pytest.mark.parametrize("power", [1, 2, 4])
def test_two_drivers_of_one_slide_are_named(power, share, tmp_path, capsys):
    """Velocities differ at the start, accelerations at the start, or motions later."""
    motion = [0.0, 3.0, 0.0, 0.0, 0.0]
    other = list(motion)
    other[power] += 3.0 * share
    path = str(tmp_path / "twice.toml")
    twice_driven(motion, other).save(path)
    for command in COMMANDS:
        main([command, path])
        shown = capsys.readouterr()
        assert "the drivers of left and right contradict each other" in " ".join(
            (shown.out + shown.err).split()
        )


def test_drivers_that_agree_run():
    run = simulate(twice_driven([0.0, 0.5, -1.0], [0.0, 0.5, -1.0]), times=[0.5, 1.0])
    assert run.outcome.name == "COMPLETED"
    assert np.allclose(run.position[:, 0, 0], [0.0, -0.5], atol=1e-12)


def test_a_table_contradicts_a_line_only_where_it_leaves_it():
    rows = [(t, 0.4 * t) for t in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)]
    line = {"joint": "left", "polynomial": [0.0, 0.4]}
    scene = twice_driven([0.0, 0.4], [0.0, 0.4])
    agreed = scene.with_(driver=[line, {"joint": "right", "table": rows}])
    assert simulate(agreed, times=[1.0]).outcome.name == "COMPLETED"
    bent = [(t, x if t < 0.7 else x + 0.01) for t, x in rows]
    with pytest.raises(SceneError, match="contradict each other"):
        simulate(scene.with_(driver=[line, {"joint": "right", "table": bent}]), times=[1.0])


def test_drivers_of_both_cranks_of_a_parallelogram_must_agree():
    """Both cranks turn alike: equal rates agree, other rates contradict, through the coupler."""
    scene = parallelogram(0.6, 0.8)
    alike = [{"joint": name, "polynomial": [0.0, 0.4]} for name in "AD"]
    assert simulate(scene.with_(driver=alike), times=[1.0]).outcome.name == "COMPLETED"
    other = [alike[0], {"joint": "D", "polynomial": [0.0, 0.4, 1e-5]}]
    with pytest.raises(SceneError, match=r"driver\[D\]: the drivers of A and D contradict each other"):
        simulate(scene.with_(driver=other), times=[1.0])
    with pytest.raises(SceneError, match="the drivers of A and D contradict each other"):
        equilibria(scene.with_(driver=other))
    assert diagnose(scene.with_(driver=other)).counts.degrees_of_freedom == 0


def test_one_driver_that_reaches_a_dead_position_is_no_contradiction():
    """A crank that cannot follow its driver has one driver alone."""
    scene = parallelogram(0.6, 0.8).with_(driver=[{"joint": "A", "polynomial": [0.0, 0.4]}])
    assert simulate(scene, times=[1.0]).outcome.name == "COMPLETED"
