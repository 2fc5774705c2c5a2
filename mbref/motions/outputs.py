"""Outputs: the names, units and meanings of all time-dependent numbers of a motion.

``Motion.columns``, CSV files, tables, plots, ``mbref list outputs`` and docs/outputs.md follow this table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from mbref.input_error import InputError
from mbref.scene.bodies import DRIVER
from mbref.scene.fields import meant

Owner = Literal["body", "joint", "driver", "motor", "load", "mechanism"]
PREFIXES: dict[Owner, str] = {  # prefix of a column, by its owner
    "body": "{}.",
    "joint": "{}.",
    "driver": f"{DRIVER}.",
    "motor": "motor({}).",
    "load": "load({}).",
    "mechanism": "",
}
EXAMPLES: dict[Owner, str] = {
    "body": "rod",
    "joint": "A",
    "driver": "A",
    "motor": "A",
    "load": "0",
    "mechanism": "",
}
MASSES = "the mass and inertia of every body"
ACCELERATIONS = "accelerations, which the engine does not give"
SECOND_RUN = "a second run: mbref run without --estimate no, or mbref.with_error_estimate before"
TURNING = "a joint that turns about one axis"
SLIDING = "a joint that slides along one axis"
ORIENTED_BALL = "a ball joint with driven orientation"
LOAD_ABOUT_AXIS = "a load about a joint's axis"
LOAD_ALONG_AXIS = "a load along a joint's axis"
SOMETIMES = "joints or couplings with intervals (`active`)"
MOTORS = "motors: mbref run or plot with --motors, or mbref.inverse_dynamics"
PULLING = f"a spring, or {LOAD_ALONG_AXIS}"


class Output(NamedTuple):
    """A time-dependent number of a body, joint, driver, load or mechanism: name, unit, components and
    meaning.

    ``needs`` names the data that a motion without this number lacks.
    """

    owner: Owner
    name: str
    unit: str
    components: str
    meaning: str
    needs: str = ""

    @property
    def column(self) -> str:
        """Example of the column's name, with all components."""
        axes = f".{self.components[0]}…{self.components[-1]}" if self.components else ""
        return f"{PREFIXES[self.owner].format(EXAMPLES[self.owner])}{self.name}{axes}"

    @property
    def shape(self) -> str:
        """Shape of the array in Python, for k sample times."""
        return f"(k, {len(self.components)})" if self.components else "(k,)"

    def columns(self, owner: str, values: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        """Yield names and values (k,) of the columns for an owner's values (k,) or (k, components)."""
        name = f"{PREFIXES[self.owner].format(owner)}{self.name}"
        if not self.components:
            yield name, values
        for i, component in enumerate(self.components):
            yield f"{name}.{component}", values[:, i]


OUTPUTS = (
    Output("body", "orientation", "", "wxyz", "unit quaternion, body to world"),
    Output("body", "position", "m", "xyz", "centre of mass, world"),
    Output("body", "velocity", "m/s", "xyz", "velocity of the centre of mass, world"),
    Output("body", "angular_velocity", "rad/s", "xyz", "angular velocity, world"),
    Output("body", "acceleration", "m/s²", "xyz", "acceleration of the centre of mass, world", ACCELERATIONS),
    Output("body", "angular_acceleration", "rad/s²", "xyz", "angular acceleration, world", ACCELERATIONS),
    Output("joint", "angle", "rad", "", "angle about the axis since t = 0, full turns counted", TURNING),
    Output("joint", "rate", "rad/s", "", "rate of the angle", TURNING),
    Output("joint", "displacement", "m", "", "displacement along the axis since t = 0", SLIDING),
    Output("joint", "displacement_rate", "m/s", "", "rate of the displacement", SLIDING),
    Output(
        "joint", "open", "", "", "number of reaction components that equilibrium does not determine", MASSES
    ),
    Output("joint", "force", "N", "xyz", "reaction on the second body at its anchor, world", MASSES),
    Output("joint", "moment", "N m", "xyz", "reaction moment on the second body, world", MASSES),
    Output("joint", "active", "", "", "1 where the joint constrains, else 0", SOMETIMES),
    Output("joint", "impulse", "N s", "xyz", "sum of its impulses of force so far, world", SOMETIMES),
    Output("joint", "angular_impulse", "N m s", "xyz", "sum of its impulses of moment, world", SOMETIMES),
    Output(
        "driver",
        "force",
        "N",
        "",
        "force on the second body along the axis of a sliding joint",
        f"{MASSES}, and {SLIDING}",
    ),
    Output(
        "driver",
        "torque",
        "N m",
        "",
        "torque on the second body about the axis of a turning joint",
        f"{MASSES}, and {TURNING}",
    ),
    Output(
        "driver", "moment", "N m", "xyz", "moment on the second body, world", f"{MASSES}, and {ORIENTED_BALL}"
    ),
    Output(
        "driver", "power", "W", "", "power into the mechanism: torque times rate, or force times rate", MASSES
    ),
    Output(
        "driver",
        "open",
        "",
        "",
        "1 where equilibrium does not determine the force or torque, else 0",
        MASSES,
    ),
    Output("motor", "force", "N", "", "force of a motor along the axis, in place of the drivers", MOTORS),
    Output("motor", "torque", "N m", "", "torque of a motor about the axis, in place of the drivers", MOTORS),
    Output(
        "motor", "power", "W", "", "power into the mechanism: torque times rate, or force times rate", MOTORS
    ),
    Output("motor", "open", "", "", "1 where other motors can replace this one, else 0", MOTORS),
    Output("load", "length", "m", "", "length of a spring", "a spring"),
    Output("load", "length_rate", "m/s", "", "rate of the length of a spring", "a spring"),
    Output("load", "force", "N", "", "pull of a spring; force on the second body along an axis", PULLING),
    Output("load", "angle", "rad", "", "angle of its joint since t = 0", LOAD_ABOUT_AXIS),
    Output("load", "rate", "rad/s", "", "rate of the angle of its joint", LOAD_ABOUT_AXIS),
    Output("load", "displacement", "m", "", "displacement of its joint since t = 0", LOAD_ALONG_AXIS),
    Output("load", "displacement_rate", "m/s", "", "rate of the displacement of its joint", LOAD_ALONG_AXIS),
    Output("load", "torque", "N m", "", "torque on the second body about the axis", LOAD_ABOUT_AXIS),
    Output("load", "power", "W", "", "power into the bodies"),
    Output("load", "energy", "J", "", "energy that a spring stores", "a spring"),
    Output("mechanism", "position_violation", "m or rad", "", "largest violation of a constraint row"),
    Output("mechanism", "velocity_violation", "m/s or rad/s", "", "largest violation at velocity level"),
    Output(
        "mechanism",
        "acceleration_violation",
        "m/s² or rad/s²",
        "",
        "largest violation at acceleration level",
        ACCELERATIONS,
    ),
    Output("mechanism", "largest_reaction", "N", "", "largest reaction force of a joint", MASSES),
    Output("mechanism", "kinetic_energy", "J", "", "kinetic energy", MASSES),
    Output("mechanism", "potential_energy", "J", "", "energy of gravity and springs", MASSES),
    Output("mechanism", "energy", "J", "", "kinetic plus potential energy", MASSES),
    Output("mechanism", "error_estimate", "", "", "estimated error, relative or rad", SECOND_RUN),
)
UNIT_OF = {output.name: output.unit for output in OUTPUTS}


def columns_of(owner: Owner, name: str, numbers: Mapping[str, Any]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the columns of an owner: its numbers that the table of outputs contains and that are not None."""
    for output in OUTPUTS:
        if output.owner == owner and (values := numbers.get(output.name)) is not None:
            yield from output.columns(name, values)


def all_columns(motion: Any, names: Sequence[str] = ()) -> dict[str, np.ndarray]:
    """Return ``time`` and all columns (k,) of a Motion, by name; with ``names`` of columns or their
    beginnings, the columns of their owners only."""
    scene, table = motion.mechanism, {"time": motion.times}
    owners: dict[tuple[Owner, str], Callable[[], Any]] = {
        **{("body", name): partial(motion.__getitem__, name) for name in motion.bodies},
        **{("joint", joint.name): partial(motion.joint, joint.name) for joint in scene.joint},
        **{("driver", each.joint): partial(motion.driver, each.joint) for each in scene.driver},
        **{("motor", name): partial(motion.motors.__getitem__, name) for name in motion.motors},
        **{("load", str(place)): partial(motion.load_at, place) for place in range(len(scene.load))},
    }
    wanted = tuple(f"{name}." for name in names)
    beginnings = {name[: k + 1] for name in wanted for k, letter in enumerate(name) if letter == "."}
    for (owner, name), find in owners.items():
        prefix = PREFIXES[owner].format(name)
        if not names or prefix in beginnings or prefix.startswith(wanted):
            table.update(columns_of(owner, name, vars(find())))
    table.update(columns_of("mechanism", "", _totals(motion, names)))
    return table


def chosen_columns(motion: Any, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return ``time`` and the columns (k,) of a Motion with these names or beginnings; raises InputError as
    ``chosen``. Columns of other owners, such as reactions of their joints, are not computed."""
    table = all_columns(motion, names)
    if not all(_fitting(table, name) for name in names):
        table = all_columns(motion)  # the message lists the existing ones
    return {name: table[name] for name in ["time", *chosen(table, names)]}


def _totals(motion: Any, names: Sequence[str]) -> dict[str, np.ndarray | None]:
    """Return the numbers of the whole mechanism by their names in the table of outputs; with ``names``, those
    numbers only."""
    known: dict[str, Callable[[], np.ndarray | None]] = {
        f"{level}_violation": partial(lambda level: getattr(motion.violation, level), level)
        for level in ("position", "velocity", "acceleration")
    }
    known["largest_reaction"] = lambda: motion.largest_reaction
    if motion.mechanism.has_mass():
        energies = ("kinetic_energy", "potential_energy", "energy")
        known |= {name: partial(getattr, motion, name) for name in energies}
    known["error_estimate"] = lambda: motion.error_estimate and motion.error_estimate.error
    return {name: find() for name, find in known.items() if not names or name in names}


def chosen(columns: Mapping[str, Any] | Sequence[str], names: Sequence[str]) -> list[str]:
    """Return the columns with these names or beginnings, such as ``rod.position``.

    Raises InputError for a name that fits no column. The message names the missing data, a similar name, or
    the existing columns.
    """
    found: list[str] = []
    for name in names:
        if not (fitting := _fitting(columns, name)):
            raise InputError(f"no column {name!r}{_hint(list(columns), name)}")
        found += [column for column in fitting if column not in found]
    return found


def _fitting(columns: Iterable[str], name: str) -> list[str]:
    return [column for column in columns if column == name or column.startswith(f"{name}.")]


def quantity_of(column: str) -> str:
    """Return the quantity of a column: ``position`` of ``rod.position.x``, ``angle`` of ``A.angle``; empty if
    the name has none."""
    return next((part for part in reversed(column.split(".")) if part in UNIT_OF), "")


def _hint(columns: Sequence[str], name: str) -> str:
    """Return the data that the column needs, a similar name, or the existing columns, as a clause."""
    parts = [column.split(".") for column in columns]
    beginnings = list(dict.fromkeys(".".join(p[:n]) for p in parts for n in range(1, len(p) + 1)))
    owner, _, quantity = name.rpartition(".")
    needs = f" in this motion; it needs {_needs(owner, quantity)}" * bool(_needs(owner, quantity))
    if needs and (not owner or owner in beginnings):
        return needs
    owners = dict.fromkeys(c[: c.index(quantity_of(c))].rstrip(".") or c for c in columns if c != "time")
    return meant(name, beginnings) or needs or f"; there are columns of {', '.join(owners)}"


def _needs(owner: str, quantity: str) -> str:
    """Return the data that the motion lacks for a quantity of an owner, by the owner's type."""
    own = ("mechanism",) if not owner else ("body", "joint")
    kinds = (owner.partition("(")[0],) if owner.endswith(")") else own
    return next((o.needs for o in OUTPUTS if o.name == quantity and o.owner in kinds), "")
