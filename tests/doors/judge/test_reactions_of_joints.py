"""Reactions of joints in a table are judged by the motion, as far as the constraints determine them."""

import numpy as np
import pytest

import crosscheck
from crosscheck.cli import main
from tests.helpers.tables import FORMATS, Table, spinning_rod, write_table

SPEED, PULL = 16.0, 128.0  # rad/s; m ω² r of the rod in N
TIMES = np.linspace(0.0, 1.0, 41)


def pulls(scale: float = 1.0) -> Table:
    """Return the exact force of the hinge on the spinning rod, which points to the axis, and no moment."""
    angle = SPEED * TIMES
    table = {"time": TIMES, "A.force.x": -PULL * np.cos(angle), "A.force.y": -PULL * np.sin(angle)}
    table |= {f"A.{name}": 0 * TIMES for name in ("force.z", "moment.x", "moment.y")}
    return {n: c if n == "time" else scale * c for n, c in table.items()}


def test_table_of_the_closed_form_of_reactions_is_right_in_each_column():
    """The hinge pulls the rod to the axis with m ω² r = 128 N and has no moment: five columns."""
    found = crosscheck.judge_motion(spinning_rod(), pulls())
    assert found.is_right and len(found.columns) == 5 and not found.left


@pytest.mark.parametrize(("scale", "says"), [(-1.0, "factor -1"), (1.01, "factor of 1.01")])
def test_reactions_times_a_factor_are_off_and_the_factor_is_named(scale, says):
    """The table is the closed form times -1 or 1.01; zeros times a factor remain right."""
    found = crosscheck.judge_motion(spinning_rod(), pulls(scale))
    assert {c.name for c in found.columns if not c.is_right} == {"A.force.x", "A.force.y"}
    assert says in found.explanations[0].sentence


def test_reactions_that_redundant_hinges_share_are_left_out_and_the_angle_is_judged():
    """Two hinges on one axis share the force of 128 N in parts that the constraints don't determine."""
    rod = spinning_rod()
    twice = rod.with_(joint=[rod.joint[0], rod.joint[0].model_copy(update={"name": "B"})])
    found = crosscheck.judge_motion(twice, {**pulls(), "A.angle": SPEED * TIMES})
    assert found.is_right and [c.name for c in found.columns] == ["A.angle"]
    assert set(found.left) == set(pulls()) - {"time"}


def test_force_in_kilonewtons_is_right_by_the_unit_in_its_header(tmp_path, capsys):
    """The table has the closed form over 1000, with the header ``A.force.x [kN]``."""
    spinning_rod().save(tmp_path / "rod.toml")
    table = {n.replace("force.x", "force.x [kN]"): c for n, c in pulls().items()}
    table["A.force.x [kN]"] = table["A.force.x [kN]"] / 1e3
    path = write_table(table, tmp_path / "run.csv", FORMATS["repr"])
    assert main(["judge", str(tmp_path / "rod.toml"), str(path)]) == 0
    assert "A.force.x" in (shown := capsys.readouterr().out) and "not read" not in shown
