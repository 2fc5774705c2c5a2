"""`judge` and `reference` of scenes whose constraints come and go: right and wrong tables of closed forms."""

import numpy as np
import pytest

import crosscheck
import mbref
from crosscheck.cli import main
from mbref.scene import Scene
from tests.helpers.intermittent_mechanisms import carts, intermittent_mechanism
from tests.helpers.parts import block, slide

FALL = np.sqrt(2 / 9.81)  # s from 1 m above the floor
SPEED = 9.81 * FALL  # m/s at the floor


def ball() -> Scene:
    """A ball of 1 kg, 1 m above a floor from which it rebounds with half of its speed."""
    rail = slide("A", "ground", "ball", (0.0, 1.0, 0.0), (0.0, 1.0, 0.0))
    return Scene(
        name="ball",
        gravity=(0.0, -9.81, 0.0),
        duration=0.85,
        body=[block("ball", (0.0, 1.0, 0.0), 1.0)],
        joint=[rail | {"stop": {"lower": -1.0, "restitution": 0.5}}],
    )


def bounced(times, restitution=0.5, late=0.0, side=1):
    """Return the table of the ball: it flies, and rebounds ``late`` (s). At the rebound it has the velocity
    after it, or before it for ``side`` -1."""
    after = times - FALL - late
    flies = after < 0 if side > 0 else after <= 0
    rebound = restitution * SPEED
    low = 1 - 9.81 * (FALL + late) ** 2 / 2
    height = np.where(flies, 1 - 9.81 * times**2 / 2, low + rebound * after - 9.81 * after**2 / 2)
    speed = np.where(flies, -9.81 * times, rebound - 9.81 * after)
    energy = speed**2 / 2 + 9.81 * height
    moved = {"A.displacement": height - 1, "A.displacement_rate": speed}
    return {"time": times, "ball.position.y": height, "ball.velocity.y": speed, "energy": energy, **moved}


@pytest.mark.parametrize("side", [-1, 1])
def test_closed_form_of_a_rebound_is_right_with_either_velocity_at_the_impact(side):
    """The table has a sample at the impact, where a tool may write the velocity before or after it."""
    times = np.unique([*np.linspace(0.0, 0.85, 18), FALL])
    found = crosscheck.judge_motion(ball(), bounced(times, side=side))
    assert found.is_right and len(found.columns) == 5, found
    table = crosscheck.reference_table(ball(), times)
    assert all(np.abs(column - table[name]).max() < 1e-11 for name, column in bounced(times).items())


@pytest.mark.parametrize("change", [{"restitution": 0.5001}, {"late": 1e-4}])
def test_wrong_rebound_is_off_from_the_impact_on(change):
    """Until the impact at 0.4515 s the table is right; the next sample is at 0.5 s."""
    found = crosscheck.judge_motion(ball(), bounced(np.linspace(0.0, 0.85, 18), **change))
    assert [column.begins for column in found.columns] == pytest.approx([0.5] * 5)
    assert not (found.is_right or found.explanations)


@pytest.mark.parametrize(
    ("latched", "status", "says"), [(0.1, 0, ""), (0.11, 1, "No explanation is searched")]
)
def test_command_judges_a_table_of_carts_that_latch_at_their_common_speed(
    latched, status, says, tmp_path, capsys
):
    """Carts of 1 kg at 2 m/s and 3 kg at -1 m/s latch at 0.1 s, with -0.25 m/s by their momentum; a table
    in which they latch at 0.11 s is wrong. It has six decimals, times four, in rows not evenly spaced."""
    carts().save(tmp_path / "carts.toml")
    times = np.sort(np.random.default_rng(1).uniform(0.0, 0.5, 20)).round(4)
    place = np.where(times < latched, 2.0 * times, 2.0 * latched - 0.25 * (times - latched))
    rows = [f"{t:.4f},{x:.6f},{2.0 if t < latched else -0.25:.6f}" for t, x in zip(times, place, strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["t,one.position.x,one.velocity.x", *rows]), encoding="utf-8")
    assert main(["judge", str(tmp_path / "carts.toml"), str(tmp_path / "run.csv")]) == status
    assert says in capsys.readouterr().out


@pytest.mark.slow  # the references take 10 s; carts and ball above are the guard
@pytest.mark.parametrize("seed", [3, 8, 11])
def test_motion_of_a_random_mechanism_is_right_in_every_column_that_a_table_can_have(seed):
    """Joints and couplings hold in intervals. A body has 19 columns: its pose 7, its four rates 3 each."""
    scene = intermittent_mechanism(seed)
    motion = mbref.simulate(scene, times=np.linspace(0.0, scene.duration, 31))
    found = crosscheck.judge_motion(scene, {"time": motion.times, **motion.columns()})
    assert found.is_right and len(found.columns) > 19 * len(scene.body), found
