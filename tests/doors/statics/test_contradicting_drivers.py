"""Two drivers of one freedom are named if their motions differ, and move it if they agree."""

import numpy as np
import pytest

from mbref import Limits, Scene, SceneError, equilibria, simulate
from mbref.cli.commands import main
from mbref.ensembles.simulate_all import simulate_all
from tests.helpers.dead_positions import pushed, turned
from tests.helpers.statics import hinge, parallelogram, rod, slide

TIMES = np.array([0.5, 1.0])  # s
COMMANDS = {"run": 2, "diagnose": 0, "equilibrium": 2}  # and their exit status; diagnose only reports


def twice_driven(left: dict, right: dict) -> Scene:
    """Return a block on two slides along x, "left" and "right", each with a driver of these fields."""
    joints = [slide(name, "block", (0.3, 0.0, 0.0), (1.0, 0.0, 0.0)) for name in ("left", "right")]
    drivers = [{"joint": "left", **left}, {"joint": "right", **right}]
    return Scene(name="twice", body=[rod("block", (0.0, 0.0, 0.0))], joint=joints, driver=drivers)


@pytest.mark.parametrize("share", [0.5, 1e-3, 1e-8])
@pytest.mark.parametrize("power", [1, 2, 4])
def test_commands_name_two_drivers_of_one_slide_whose_motions_differ(power, share, tmp_path, capsys):
    """One driver moves the slide by 3 t m, the other by 3 t + 3 share tⁿ m, n = 1, 2 or 4: velocities or
    accelerations differ at the start, or places later."""
    motion = [0.0, 3.0, 0.0, 0.0, 0.0]
    other = [number + 3.0 * share * (k == power) for k, number in enumerate(motion)]
    path = str(tmp_path / "twice.toml")
    twice_driven({"polynomial": motion}, {"polynomial": other}).save(path)
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
    scene = twice_driven({"polynomial": [0.0, 0.4]}, other)
    with pytest.raises(SceneError, match="the drivers of left and right contradict each other"):
        simulate(scene, times=[1.0])


@pytest.mark.parametrize("order", [1, -1])
def test_table_of_13_digits_agrees_with_its_cubic_from_rest(order):
    """Both drivers move the slide by x(t) = 0.3 t² - 0.1 t³ m; rates differ by the table's rounding."""

    def x(t):
        return 0.3 * t**2 - 0.1 * t**3

    rows = [(t, round(x(t), 13)) for t in np.linspace(0.0, 1.0, 41)]
    scene = twice_driven({"polynomial": [0.0, 0.0, 0.3, -0.1]}, {"table": rows})
    run = simulate(scene.with_(driver=scene.driver[::order]), times=TIMES)
    assert run.outcome.name == "COMPLETED"
    assert np.allclose(run.position[:, 0, 0], x(TIMES), rtol=0, atol=1e-11)  # m


@pytest.mark.parametrize("further", [0.1, 1e-5, 1e-8])
@pytest.mark.parametrize("angle", [0.0, 0.6], ids=["flat", "not flat"])
def test_drivers_of_both_cranks_of_a_parallelogram_are_named_unless_they_turn_alike(angle, further):
    """Cranks of 1 m turn by equal angles. (Where the parallelogram is flat, the rows of both drivers are
    independent nevertheless.) If both are driven by 0.4 t rad, the coupler is sin(angle + 0.4) m high at 1 s.
    A driver of D by 0.4 t + ``further`` t² contradicts the one of A."""
    alike = [{"joint": name, "polynomial": [0.0, 0.4]} for name in "AD"]
    scene = parallelogram(sine=np.sin(angle), cosine=np.cos(angle))
    run = simulate(scene.with_(driver=alike), times=[1.0])
    assert run.position[0, 1, 1] == pytest.approx(np.sin(angle + 0.4), abs=1e-12)  # m
    other = scene.with_(driver=[alike[0], {"joint": "D", "polynomial": [0.0, 0.4, further]}])
    for ask in (lambda: simulate(other, times=[1.0]), lambda: equilibria(other)):
        with pytest.raises(SceneError, match=r"driver\[D\]: the drivers of A and D contradict each other"):
            ask()


def test_drivers_of_two_coupled_wheels_agree_over_many_turns_or_are_named():
    """Wheel a is driven by 10 t rad, b by -3.7 t rad, as the gears demand; c follows by 200 t rad, over half
    a turn between two of the poses that are compared. Then b is driven 1e-6 t² rad further."""
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
    """Both drivers move the block by 0.5 t m and a sine, whose amplitude is 1e-12 m in three scenes. In a
    fourth one the right driver's is ``share`` m. At 16 π rad/s the sine is zero at both samples."""

    def scene(amplitude: float) -> Scene:
        waves = ({"amplitude": a, "frequency": frequency} for a in (1e-12, amplitude))
        return twice_driven(*({"polynomial": [0.0, 0.5], "sine": wave} for wave in waves))

    agreed = [scene(1e-12)] * 3
    for run in simulate_all(agreed, "taylor", TIMES, Limits()):
        assert np.allclose(run.position[:, 0, 0], [0.25, 0.5], rtol=0, atol=1e-9)  # m
    with pytest.raises(SceneError, match="the drivers of left and right contradict each other"):
        simulate_all([*agreed, scene(share)], "taylor", TIMES, Limits())
