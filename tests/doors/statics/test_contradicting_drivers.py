"""Two drivers of one freedom are named if their motions differ, and move it if they agree."""

import numpy as np
import pytest

from mbref import Limits, Scene, SceneError, equilibria, simulate
from mbref.cli.commands import main
from mbref.ensembles.simulate_all import simulate_all
from tests.helpers.dead_positions import pushed, turned
from tests.helpers.statics import hinge, parallelogram, rod, slide

TIMES = np.array([0.5, 1.0])  # s, of scenes in a batch
COMMANDS = {"run": 2, "diagnose": 0, "equilibrium": 2}  # and their exit status; diagnose only reports


def twice_driven(first, second) -> Scene:
    """A block on two slides along x, each with a driver."""
    joints = [slide(name, "block", (0.3, 0.0, 0.0), (1.0, 0.0, 0.0)) for name in ("left", "right")]
    drivers = [
        {"joint": name, "polynomial": list(motion)}
        for name, motion in zip(("left", "right"), (first, second), strict=True)
    ]
    return Scene(name="twice", body=[rod("block", (0.0, 0.0, 0.0))], joint=joints, driver=drivers)


@pytest.mark.parametrize("share", [0.5, 1e-3, 1e-8])
@pytest.mark.parametrize("power", [1, 2, 4])
def test_commands_name_two_drivers_of_one_slide_whose_motions_differ(power, share, tmp_path, capsys):
    """One driver moves the slide by 3 t m, the other by 3 t + 3 share tⁿ m, n = 1, 2 or 4: velocities or
    accelerations differ at the start, or places later."""
    motion = [0.0, 3.0, 0.0, 0.0, 0.0]
    other = [number + 3.0 * share * (k == power) for k, number in enumerate(motion)]
    path = str(tmp_path / "twice.toml")
    twice_driven(motion, other).save(path)
    for command, status in COMMANDS.items():
        assert main([command, path]) == status
        shown = " ".join("".join(capsys.readouterr()).split())
        assert "the drivers of left and right contradict each other" in shown


ROWS = [(t, 0.4 * t) for t in np.linspace(0.0, 1.0, 101).tolist()]  # a table of 0.4 t m
WAVE = {"amplitude": 1e-11, "frequency": 1e3}  # m, rad/s
CRESTS = {"amplitude": 1e-7, "frequency": 200 * np.pi, "phase": np.pi / 2}  # 1e-7 m at t = 0, 0.01 … s


@pytest.mark.parametrize(
    "other",
    [
        {"polynomial": [0.0, 0.4], "sine": WAVE},
        {"polynomial": [-1e-7, 0.4], "sine": CRESTS},
        {"table": [*ROWS[:50], (0.5, 0.2 + 1e-7), *ROWS[51:]]},
    ],
    ids=["by 1e-8 m/s of rate", "only between multiples of 10 ms", "at one row of a table"],
)
def test_drivers_that_differ_in_rate_or_at_few_times_are_named(other):
    """One driver moves the slide by 0.4 t m. The other adds 1e-11 sin(1000 t) m, whose rate is up to 1e-8
    m/s; or 1e-7 (cos(200 π t) - 1) m, zero at multiples of 10 ms; or 1e-7 m to the table's row at 0.5 s."""
    scene = twice_driven([0.0, 0.4], [0.0]).with_(
        driver=[{"joint": "left", "polynomial": [0.0, 0.4]}, {"joint": "right", **other}]
    )
    with pytest.raises(SceneError, match="the drivers of left and right contradict each other"):
        simulate(scene, times=[1.0])


@pytest.mark.parametrize("order", [1, -1])
def test_table_of_13_digits_agrees_with_its_cubic_from_rest(order):
    """Both are 0.3 t² - 0.1 t³ m; the rates at the start differ by rounding."""
    rows = [(t, round(0.3 * t**2 - 0.1 * t**3, 13)) for t in np.linspace(0.0, 1.0, 41)]
    drivers = [{"joint": "left", "polynomial": [0.0, 0.0, 0.3, -0.1]}, {"joint": "right", "table": rows}]
    run = simulate(twice_driven([0.0], [0.0]).with_(driver=drivers[::order]), times=[0.5, 1.0])
    assert run.outcome.name == "COMPLETED"
    assert np.allclose(run.position[:, 0, 0], [0.0625, 0.2], atol=1e-11)  # m


@pytest.mark.parametrize("further", [0.1, 1e-5, 1e-8])
@pytest.mark.parametrize("angle", [0.0, 0.6], ids=["flat", "not flat"])
def test_drivers_of_both_cranks_of_a_parallelogram_are_named_unless_they_turn_alike(angle, further):
    """Links of 1 m: both cranks have equal angles, although rows of both drivers are independent where it is
    flat. Driven by 0.4 t rad, the coupler is sin(angle + 0.4) m high; one is then driven further t² more."""
    alike = [{"joint": name, "polynomial": [0.0, 0.4]} for name in "AD"]
    scene = parallelogram(np.sin(angle), np.cos(angle))
    run = simulate(scene.with_(driver=alike), times=[1.0])
    assert run.position[0, 1, 1] == pytest.approx(np.sin(angle + 0.4), abs=1e-12)  # m
    other = scene.with_(driver=[alike[0], {"joint": "D", "polynomial": [0.0, 0.4, further]}])
    for ask in (lambda: simulate(other, times=[1.0]), lambda: equilibria(other)):
        with pytest.raises(SceneError, match=r"driver\[D\]: the drivers of A and D contradict each other"):
            ask()


def test_drivers_of_two_coupled_wheels_agree_over_many_turns_or_are_named():
    """Wheel a turns by 10 t rad, b by -3.7 t, and a third one by 200 t: over half a turn between two compared
    poses. Then b is driven 1e-6 t² rad further."""
    bodies = [rod(name, (k + 0.3, 0.0, 0.0)) for k, name in enumerate("abc")]
    joints = [hinge(name.upper(), ("ground", name), (k, 0.0, 0.0)) for k, name in enumerate("abc")]
    gears = [{"name": f"A{n}", "joints": ["A", n], "ratio": r} for n, r in (("B", -0.37), ("C", 20.0))]
    scene = Scene(name="gears", body=bodies, joint=joints, coupling=gears)
    drivers = [{"joint": "A", "polynomial": [0.0, 10.0]}, {"joint": "B", "polynomial": [0.0, -3.7]}]
    run = simulate(scene.with_(driver=drivers), times=[1.0])
    assert [run.joint(name).angle[0] for name in "ABC"] == pytest.approx([10.0, -3.7, 200.0], rel=1e-12)
    other = {"joint": "B", "polynomial": [0.0, -3.7, 1e-6]}
    with pytest.raises(SceneError, match="the drivers of A and B contradict each other"):
        simulate(scene.with_(driver=[drivers[0], other]), times=[1.0])


@pytest.mark.parametrize(
    "made",
    [lambda: turned(0.5, 0.4, 0.3, 4.0), lambda: pushed(0.2, 0.5, 1.0, 0.7)],
    ids=["driven crank", "driven slider"],
)
def test_single_driver_at_a_dead_position_is_no_contradiction_of_drivers(made):
    """The run ends at the time of the closed form, to 1e-9 of it, and its message names this time."""
    scene, dead = made()
    run = simulate(scene, times=[0.5 * dead, 2.0 * dead])
    assert run.t_end == pytest.approx(dead, rel=1e-9) and run.times.tolist() == [0.5 * dead]
    assert f"the drivers come to a dead position at t = {dead:.6g} s" in run.message


@pytest.mark.parametrize("share", [1e-4, 1e-7])
@pytest.mark.parametrize("frequency", [1.0, 16 * np.pi])
def test_contradicting_drivers_of_any_scene_of_an_ensemble_are_named(share, frequency):
    """Three scenes have drivers that agree, and move by 0.5 t. In the fourth one of the drivers adds a sine,
    which is zero at the samples of 0.5 s and 1 s for the frequency 16 π rad/s."""

    def scene(amplitude: float) -> Scene:
        motions = [
            {"joint": name, "polynomial": [0.0, 0.5], "sine": {"amplitude": a, "frequency": frequency}}
            for name, a in (("left", 1e-12), ("right", amplitude))
        ]
        return twice_driven([0.0], [0.0]).with_(driver=motions)

    agreed = [scene(1e-12)] * 3
    for run in simulate_all(agreed, "taylor", TIMES, Limits()):
        assert np.allclose(run.position[:, 0, 0], [0.25, 0.5], atol=1e-9)  # m
    with pytest.raises(SceneError, match="the drivers of left and right contradict each other"):
        simulate_all([*agreed, scene(share)], "taylor", TIMES, Limits())
