"""Loads of joints and functions of time: closed forms, methods that agree, switching, faults, numbers."""

import numpy as np
import pytest

import mbref
from mbref.scene import Factor, JointForce, Scene, SceneError
from mbref.scene.toml import scene_text
from tests.helpers import loads_over_time as scenes
from tests.helpers.loads_over_time import AXIS, WAVY

METHODS = ("taylor", "alf-dual+projection/dop853", "lm1+none/adams")
TIMES = np.linspace(0.0, 2.0, 17)


def run(scene: Scene, method: str, times=TIMES) -> mbref.Motion:
    motion = mbref.simulate(scene, method=method, times=times, rtol=1e-13)
    assert motion.outcome.name == "COMPLETED", motion.message
    return motion


def test_acceleration_at_the_time_of_switching_is_the_one_afterwards():
    """A force of 2 N acts on 2 kg from 0.5 s to 1.5 s: 0, 1, 1 and 0 m/s² at 0, 0.5, 1 and 1.5 s."""
    rounding = 1e-12  # m/s²
    for method in METHODS:
        motion = run(scenes.pushed(Factor(start=0.5, stop=1.5)), method, [0.0, 0.5, 1.0, 1.5])
        along = motion.acceleration[:, 0] @ AXIS
        assert np.allclose(along, [0.0, 1.0, 1.0, 0.0], rtol=0, atol=rounding), method


def test_step_by_series_crosses_each_polynomial_piece_of_a_table_at_once():
    """Between the times of a table the motion is a polynomial, which one step of the series crosses."""
    motion = run(scenes.pushed(Factor(table=WAVY)), "taylor", [0.0, 2.0])
    assert motion.cost.steps == 5  # pieces begin at 0, 0.3, 0.7, 1.1 and 1.6 s


def test_load_that_begins_to_act_moves_a_body_from_rest():
    """A force of 1 N/kg from a time s on moves a body by (2 - s)² / 2 m up to t = 2 s; s is late, so that the
    body stays at rest for nearly the whole run, or early."""
    for start in (1.999, 1e-3):
        scene = scenes.pushed(Factor(start=start)).with_(duration=2.0)
        moved = run(scene, "taylor", [0.0, 2.0]).joint("J").displacement[-1]
        assert moved == pytest.approx((2.0 - start) ** 2 / 2, rel=1e-9)  # rtol


def test_equilibrium_of_a_load_over_time_is_refused():
    """The torque on the wheel is a sine of time, so that no pose is at rest."""
    with pytest.raises(SceneError, match=r"load\[0\].factor: varies"):
        mbref.equilibria(scenes.wheel())


FAULTS = {
    "must have at least 4 rows": {"table": [[0.0, 0.0], [1.0, 1.0], [3.0, 2.0]]},
    "row 2 is at 0.5 s and row 1 at 1 s": {"table": [[0.0, 0.0], [1.0, 1.0], [0.5, 2.0], [3.0, 2.0]]},
    "its first row is at 0.5 s, but it acts from 0 s on": {
        "table": [[0.5, 0.0], [1.0, 1.0], [1.5, 2.0], [3.0, 2.0]]
    },
    "its last row is at 1.5 s, but it acts until 2 s": {
        "table": [[0.0, 0.0], [1.0, 1.0], [1.2, 2.0], [1.5, 2.0]]
    },
    "must be a time and a value": {"table": [[0.0, 0.0], [1.0], [1.5, 2.0], [3.0, 2.0]]},
    "must be later than start": {"start": 1.0, "stop": 0.5},
    "has no unit": {"sine": {"amplitude": "3 deg"}},
    "did you mean 'table'": {"tabel": []},
}


@pytest.mark.parametrize("message", FAULTS)
def test_faulty_function_of_time_is_refused_by_path_and_line(message, tmp_path):
    """FAULTS maps a part of each refusal to the faulty factor of a force in a scene of 2 s."""
    text = scenes.pushed(Factor()).to_dict()
    text["load"][0]["factor"] = FAULTS[message]
    path = tmp_path / "slide.toml"
    path.write_text(scene_text(text))
    with pytest.raises(SceneError) as error:
        Scene.from_file(path)
    (fault,) = error.value.faults
    line = next(n for n, row in enumerate(path.read_text().splitlines(), 1) if row.startswith("factor"))
    assert fault.startswith("load[0].factor") and message in fault and fault.endswith(f"(line {line})")


def test_force_along_a_joint_that_does_not_slide_is_refused():
    """The wheel turns on a hinge."""
    with pytest.raises(SceneError, match="only translational, cylindrical, free joints can carry a joint_f"):
        scenes.wheel().with_(load=[JointForce(joint="J", force=1.0)])
