"""The table of outputs, and the words by which columns are chosen / by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import outputs
from mbref.input_error import InputError

TABLE = """\
rod.orientation.w…z||(k, 4)
rod.position.x…z|m|(k, 3)
rod.velocity.x…z|m/s|(k, 3)
rod.angular_velocity.x…z|rad/s|(k, 3)
rod.acceleration.x…z|m/s²|(k, 3)
rod.angular_acceleration.x…z|rad/s²|(k, 3)
A.angle|rad|(k,)
A.rate|rad/s|(k,)
A.displacement|m|(k,)
A.displacement_rate|m/s|(k,)
A.open||(k,)
A.force.x…z|N|(k, 3)
A.moment.x…z|N m|(k, 3)
driver(A).force|N|(k,)
driver(A).torque|N m|(k,)
driver(A).power|W|(k,)
load(0).length|m|(k,)
load(0).length_rate|m/s|(k,)
load(0).force|N|(k,)
load(0).angle|rad|(k,)
load(0).rate|rad/s|(k,)
load(0).displacement|m|(k,)
load(0).displacement_rate|m/s|(k,)
load(0).torque|N m|(k,)
load(0).power|W|(k,)
position_violation|m or rad|(k,)
velocity_violation|m/s or rad/s|(k,)
acceleration_violation|m/s² or rad/s²|(k,)
largest_reaction|N|(k,)
kinetic_energy|J|(k,)
potential_energy|J|(k,)
energy|J|(k,)
error_estimate||(k,)"""
MASSES = "the mass and inertia of every body"
GIVEN = "accelerations, which the engine does not give"
TURNS, SLIDES = "a joint that turns about one axis", "a joint that slides along one axis"
ABOUT, ALONG = "a load about a joint's axis", "a load along a joint's axis"
NEEDS = {
    "rod.acceleration.x…z": GIVEN,
    "rod.angular_acceleration.x…z": GIVEN,
    "acceleration_violation": GIVEN,
    **dict.fromkeys(("A.angle", "A.rate"), TURNS),
    **dict.fromkeys(("A.displacement", "A.displacement_rate"), SLIDES),
    **dict.fromkeys(("A.open", "A.force.x…z", "A.moment.x…z", "driver(A).power"), MASSES),
    "driver(A).force": f"{MASSES}, and {SLIDES}",
    "driver(A).torque": f"{MASSES}, and {TURNS}",
    **dict.fromkeys(("load(0).length", "load(0).length_rate"), "a spring"),
    "load(0).force": f"a spring, or {ALONG}",
    **dict.fromkeys(("load(0).angle", "load(0).rate", "load(0).torque"), ABOUT),
    **dict.fromkeys(("load(0).displacement", "load(0).displacement_rate"), ALONG),
    "load(0).power": "a spring or a load of a joint",
    **dict.fromkeys(("largest_reaction", "kinetic_energy", "potential_energy", "energy"), MASSES),
    "error_estimate": "a second run: mbref run without --estimate no, or motion.error_estimate before",
}


def test_the_columns_of_the_table_and_what_they_need():
    found = [f"{each.column}|{each.unit}|{each.shape}" for each in outputs.OUTPUTS]
    assert "\n".join(found) == TABLE
    assert {each.column: each.needs for each in outputs.OUTPUTS if each.needs} == NEEDS
    meanings = [each.meaning for each in outputs.OUTPUTS]
    assert all(" " in meaning for meaning in meanings) and not {*meanings} & {*NEEDS.values()}


def test_columns_of_owners():
    vector = np.arange(6.0).reshape(2, 3)
    numbers = {"position": vector, "velocity": None, "colour": vector, "angle": vector[:, 0]}
    found = {name: column.tolist() for name, column in outputs.columns_of("body", "rod", numbers)}
    assert found == {"rod.position.x": [0, 3], "rod.position.y": [1, 4], "rod.position.z": [2, 5]}
    found = {name: column.tolist() for name, column in outputs.columns_of("joint", "A", numbers)}
    assert found == {"A.angle": [0, 3]}
    one = {"force": vector[:, 1], "energy": vector[:, 0]}
    assert list(dict(outputs.columns_of("driver", "A", one))) == ["driver(A).force"]
    assert list(dict(outputs.columns_of("load", "2", one))) == ["load(2).force"]
    assert list(dict(outputs.columns_of("mechanism", "", one))) == ["energy"]


COLUMNS = [
    "time",
    "rod.position.x",
    "rod.position.y",
    "rodent.position.x",
    "A.angle",
    "driver(A).power",
    "energy",
]


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        (["rod"], ["rod.position.x", "rod.position.y"]),
        (["rod.position.y", "rod", "rod"], ["rod.position.y", "rod.position.x"]),
        (["energy", "A.angle"], ["energy", "A.angle"]),
        (["driver(A)"], ["driver(A).power"]),
        ([], []),
    ],
)
def test_chosen_columns(names, columns):
    assert outputs.chosen(COLUMNS, names) == columns


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("A.force", f"no column 'A.force' in this motion; it needs {MASSES}"),
        ("rod.acceleration", f"no column 'rod.acceleration' in this motion; it needs {GIVEN}"),
        ("driver(A).torque", f"no column 'driver(A).torque' in this motion; it needs {MASSES}, and {TURNS}"),
        ("largest_reaction", f"no column 'largest_reaction' in this motion; it needs {MASSES}"),
        ("rodd.position", "no column 'rodd.position'; did you mean 'rod.position'?"),
        ("A.angel", "no column 'A.angel'; did you mean 'A.angle'?"),
        ("zzz", "no column 'zzz'; there are columns of rod, rodent, A, driver(A), energy"),
        (
            "qqqqqqqq.torque",
            "no column 'qqqqqqqq.torque'; there are columns of rod, rodent, A, driver(A), energy",
        ),
        ("QQQQQQQ.moment", f"no column 'QQQQQQQ.moment' in this motion; it needs {MASSES}"),
    ],
)
def test_columns_that_do_not_exist(name, says):
    with pytest.raises(InputError) as fault:
        outputs.chosen(COLUMNS, [name])
    assert str(fault.value) == says


@pytest.mark.parametrize(
    ("column", "quantity"),
    [("rod.position.x", "position"), ("A.angle", "angle"), ("energy", "energy"), ("force.rate", "rate")],
)
def test_quantities_of_columns(column, quantity):
    assert outputs.quantity_of(column) == quantity


def test_numbers_of_a_whole_mechanism():
    violation = SimpleNamespace(_asdict=lambda: {"position": "p", "velocity": "v", "acceleration": None})
    motion: Any = SimpleNamespace(
        violation=violation,
        mechanism=SimpleNamespace(has_mass=lambda: True),
        kinetic_energy="k",
        potential_energy="u",
        energy="e",
        largest_reaction="r",
        known_estimate=SimpleNamespace(error="d"),
    )
    levels = {"position_violation": "p", "velocity_violation": "v", "acceleration_violation": None}
    energies = {"kinetic_energy": "k", "potential_energy": "u", "energy": "e"}
    rest = {"largest_reaction": "r", "error_estimate": "d"}
    assert outputs._totals(motion) == {**levels, **energies, **rest}
    motion.mechanism, motion.known_estimate = SimpleNamespace(has_mass=lambda: False), None
    assert outputs._totals(motion) == {**levels, "largest_reaction": "r", "error_estimate": None}
