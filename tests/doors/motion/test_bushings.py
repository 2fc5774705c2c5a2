"""Bushings: damped springs whose ends coincide at the start, by the equations of a slide and of a hinge."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crosscheck.judge.gauss_principle import gauss
from mbref import Scene, simulate
from mbref.cli.commands import main
from mbref.method import MethodError
from tests.helpers.parts import spring
from tests.helpers.statics import G, pendulum, rod, slide

MASS, STIFFNESS, DAMPING, SPEED = 2.0, 80.0, 6.0, 1.5  # kg, N/m, N s/m, m/s
TIMES = [0.1, 0.5, 1.0, 2.0]
EXACT = 1e-8  # m or rad: errors of steps at the default tolerance add up to less in 2 s


def bushing(body: str, place) -> dict:
    return spring("ground", place, body, place, STIFFNESS, 0.0, DAMPING)


def on_a_slide() -> Scene:
    block = {**rod("block", (0.0, 0.0, 0.0), MASS), "velocity": [SPEED, 0.0, 0.0]}
    joint, load = slide("S", "block", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), bushing("block", (0.0, 0.2, 0.0))
    return Scene(name="bushing", body=[block], joint=[joint], load=[load])


def test_a_block_on_a_bushing_moves_as_a_damped_oscillator_and_the_message_names_the_bushing():
    """m x'' = -k x - c x', so x = v/ω e^(-δt) sin ωt and x'' = -c v / m at the start. The message says that
    the ends of the spring coincide there. Accelerations are exact to rounding."""
    run = simulate(on_a_slide(), times=[0.0, *TIMES])
    decay = DAMPING / (2 * MASS)
    rate = np.sqrt(STIFFNESS / MASS - decay**2)
    exact = SPEED / rate * np.exp(-decay * np.array(TIMES)) * np.sin(rate * np.array(TIMES))
    assert run.outcome.name == "COMPLETED"
    assert np.allclose(run.position[1:, 0, 0], exact, rtol=0.0, atol=EXACT)
    assert run.acceleration[0, 0, 0] == pytest.approx(-DAMPING / MASS * SPEED, rel=1e-12)
    assert "the ends of the damped spring load[0] coincide at the start" in run.message


def test_a_pendulum_on_a_bushing_moves_by_its_own_equation_of_motion():
    """I a'' = -m g l cos a - k r² sin a - c r² cos²(a/2) a', integrated by scipy; the bushing's length is
    2 r sin(a/2), whose rate is r cos(a/2) a'. About the hinge I = 0.3 kg m² + m l²."""
    reach, arm, about = 1.1, 0.7, 0.3 + MASS * 0.7**2
    run = simulate(pendulum(load=[bushing("rod", (reach, 0.0, 0.0))]), times=TIMES)

    def rates(t, y):
        angle, rate = y
        torque = -MASS * G * arm * np.cos(angle) - STIFFNESS * reach**2 * np.sin(angle)
        return rate, (torque - DAMPING * (reach * np.cos(angle / 2)) ** 2 * rate) / about

    exact = solve_ivp(rates, (0.0, TIMES[-1]), (0.0, 0.0), "DOP853", TIMES, rtol=1e-12, atol=1e-13).y[0]
    assert np.allclose(np.arctan2(run.position[:, 0, 1], run.position[:, 0, 0]), exact, rtol=0.0, atol=EXACT)


def test_taylor_refuses_a_bushing_and_names_the_method_to_use(tmp_path, capsys):
    """A Taylor series does not exist where the length of a damped spring is zero."""
    with pytest.raises(MethodError, match=r"load\[0\] coincide at the start.*alf-dual\+projection/dop853"):
        simulate(on_a_slide(), "taylor")
    path = str(tmp_path / "bushing.toml")
    on_a_slide().save(path)
    assert main(["run", path, "--method", "taylor"]) == 2
    assert "use alf-dual+projection/dop853" in " ".join(capsys.readouterr().err.split())


def test_acceleration_at_the_start_by_the_judge_has_the_damping_of_a_bushing_of_length_zero():
    """The block moves at v, so that x'' = -c v / m. The pendulum is at rest, so that y'' = -m g l² / I as
    without the bushing. A division by the length zero would warn, and a warning fails a test."""
    assert gauss(on_a_slide())[0, 0] == pytest.approx(-DAMPING / MASS * SPEED, rel=1e-12)
    level = pendulum((0.7, 0.0, 0.0), load=[bushing("rod", (1.0, 0.0, 0.0))])
    assert gauss(level)[0, 1] == pytest.approx(-MASS * G * 0.7**2 / (0.3 + MASS * 0.7**2), rel=1e-12)
