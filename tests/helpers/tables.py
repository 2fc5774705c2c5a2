"""Tables of exact motions, written in the formats of other tools."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from mbref.scene import Body, JointTorque, Revolute, Scene, TorsionSpring

Format = Callable[[float], str]
Table = dict[str, np.ndarray]


def stripped(decimals: int, number: float) -> str:
    """Return a number as spreadsheets show it: rounded to decimals, without trailing zeros."""
    text = f"{number:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def written(letter: str, digits: int, number: float) -> str:
    """Return a number in a format of C, such as ``%.6g``."""
    return f"{number:.{digits}{letter}}"


FORMATS: dict[str, Format] = {
    **{f"%.{d}f": partial(written, "f", d) for d in range(3, 10)},
    **{f"%.{d}g": partial(written, "g", d) for d in range(3, 18)},
    **{f"%.{d}e": partial(written, "e", d) for d in (3, 6, 12)},
    **{f"spreadsheet with {d} decimals": partial(stripped, d) for d in range(3, 10)},
    "repr": repr,
    "single precision": lambda number: str(np.float32(number)),
}


def write_table(table: Table, path: Path, form: Format, separator: str = ",") -> Path:
    """Write columns (k,) with their names as a header; return the path."""
    rows = zip(*([form(float(x)) for x in column] for column in table.values()), strict=True)
    path.write_text("\n".join([separator.join(table), *map(separator.join, rows)]), encoding="utf-8")
    return path


def damped_pendulum() -> Scene:
    """Return a pendulum with spring, damper and armature, which starts at rest and horizontal."""
    rod = Body(name="rod", mass=1.2, inertia=(0.01, 0.1, 0.1), position=(0.4, 0.0, 0.0))
    hinge = Revolute(name="A", bodies=("ground", "rod"), anchor=(0, 0, 0), axis=(0, 0, 1), armature=0.03)
    parts = {"body": [rod], "joint": [hinge], "load": [TorsionSpring(joint="A", stiffness=2.0, damping=0.15)]}
    return Scene(name="damped_pendulum", gravity=(0.0, -9.81, 0.0), duration=1.0, **parts)


def switched_motor() -> Scene:
    """Return a pendulum with a motor that is on from 0.3 s to 0.7 s."""
    motor = JointTorque(joint="A", torque=2.5, factor={"start": 0.3, "stop": 0.7})
    return damped_pendulum().with_(name="switched_motor", load=[motor])


def spinning_rod() -> Scene:
    """Return a rod that turns about a fixed axis without gravity, more than twice in a second."""
    rates = {"velocity": (0.0, 8.0, 0.0), "angular_velocity": (0.0, 0.0, 16.0)}
    rod = Body(name="rod", mass=1.0, inertia=(0.01, 0.1, 0.1), position=(0.5, 0.0, 0.0), **rates)
    hinge = Revolute(name="A", bodies=("ground", "rod"), anchor=(0, 0, 0), axis=(0, 0, 1))
    return Scene(name="spinning_rod", gravity=(0.0, 0.0, 0.0), duration=1.0, body=[rod], joint=[hinge])


def double_pendulum() -> Scene:
    """Return two rods with hinges in different directions, under a gravity along no axis."""
    upper = Body(name="upper", mass=2.0, inertia=(0.02, 0.05, 0.06), position=(0.3, 0.0, 0.0))
    lower = Body(name="lower", mass=1.0, inertia=(0.01, 0.04, 0.03), position=(0.9, 0.1, 0.0))
    first = Revolute(name="A", bodies=("ground", "upper"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    second = Revolute(name="B", bodies=("upper", "lower"), anchor=(0.6, 0.0, 0.0), axis=(0.0, 0.6, 0.8))
    parts = {"body": [upper, lower], "joint": [first, second]}
    return Scene(name="double_pendulum", gravity=(0.3, -9.81, 0.5), duration=0.4, **parts)


def turned(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Scene, Table], Table]:
    """Return the change of all quaternions (k, 4)."""

    def of(scene: Scene, table: Table) -> Table:
        found = dict(table)
        for body in scene.body:
            names = [f"{body.name}.orientation.{a}" for a in "wxyz"]
            found.update(zip(names, change(np.array([table[n] for n in names]).T).T, strict=True))
        return found

    return of
