"""Motion: a trajectory together with its scene: joints, energies, tables, files and pictures."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from mbref.drawing.picture import moving, still
from mbref.drawing.view import View
from mbref.energy import kinetic, potential
from mbref.joint_motion import JointMotion, joint_motion
from mbref.records import strict_json
from mbref.scene import Scene, SceneError
from mbref.trajectory import Trajectory

VECTORS = ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration")


@dataclass(frozen=True, repr=False)
class Motion(Trajectory):
    """A trajectory and the ``mechanism`` (a Scene) that it moves.

    ``motion["rod"].position`` (k, 3) is a body's, ``motion.joint("A").angle`` (k,) a joint's.
    """

    mechanism: Scene = field(kw_only=True)

    @staticmethod
    def of(scene: Scene, trajectory: Trajectory) -> Motion:
        """A trajectory of any engine with its scene."""
        return Motion(**{f.name: getattr(trajectory, f.name) for f in fields(Trajectory)}, mechanism=scene)

    def joint(self, name: str) -> JointMotion:
        """Angle, displacement and reaction of a joint; raises KeyError that lists the joints."""
        return joint_motion(self.mechanism, self, name)

    @property
    def kinetic_energy(self) -> np.ndarray:
        """Kinetic energy (k,), J; ValueError where a body has no mass."""
        return kinetic(self.mechanism, self)

    @property
    def potential_energy(self) -> np.ndarray:
        """Energy (k,) of gravity, springs and torsion springs, J; ValueError where a body has no mass."""
        return potential(self.mechanism, self)

    @property
    def energy(self) -> np.ndarray:
        """Kinetic plus potential energy (k,), J: constant without drivers, dampers, forces and moments."""
        return self.kinetic_energy + self.potential_energy

    def columns(self) -> dict[str, np.ndarray]:
        """Every number over time as a column (k,): ``time``, ``rod.position.x``, ``A.angle``, ``energy``."""
        table = {"time": self.times}
        for name in self.bodies:
            table.update(_body_columns(name, self[name]))
        for joint in self.mechanism.joint:
            table.update(_joint_columns(self.joint(joint.name)))
        if self.mechanism.has_mass():
            table["energy"] = self.energy
        return table

    def to_dataframe(self) -> Any:
        """The columns as a pandas DataFrame, indexed by time; raises ImportError where pandas is missing."""
        try:
            import pandas
        except ImportError:
            raise ImportError("to_dataframe needs pandas: pip install pandas; columns() does not") from None
        return pandas.DataFrame(self.columns()).set_index("time")

    def to_csv(self, path: str | Path) -> None:
        """Write the columns as CSV with a line of headings, numbers in full."""
        table = self.columns()
        with open(path, "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(table)
            writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))

    def save(self, path: str | Path) -> None:
        """Write scene and trajectory as one JSON object; ``Motion.load`` gives back an equal motion."""
        whole = {"scene": self.mechanism.to_dict(), "record": self.to_record()}
        Path(path).write_text(strict_json(whole) + "\n", encoding="utf-8")

    @staticmethod
    def load(path: str | Path) -> Motion:
        """Read what ``save`` wrote; raises OSError, or ValueError where the file holds something else."""
        try:
            whole = json.loads(Path(path).read_text(encoding="utf-8"))
            scene = Scene(**whole["scene"])
            return Motion.of(scene, Trajectory.from_record(scene.name, whole["record"]))
        except (ValueError, KeyError, TypeError, AttributeError, SceneError):
            raise ValueError(f"{path}: is not a file that Motion.save wrote") from None

    def plot(self, *names: str) -> Any:
        """Columns over time as a matplotlib figure, one panel for each quantity.

        ``names`` are columns or their beginnings (``"rod.position"``); without any, the coordinates of the
        joints and the energy.  Raises ValueError for a name of no column, ImportError without matplotlib.
        """
        from mbref.drawing.plot import plot

        return plot(self.columns(), names)

    def picture(self, view: str | None = None) -> str:
        """The moving mechanism as SVG, seen in a ``view`` (xy, xz, yz, oblique or AZIMUTH,ELEVATION in °)."""
        return moving(self.mechanism, self, View.parse(view) if view else None)

    def _repr_html_(self) -> str:
        shown = self.picture() if self.times.size else still(self.mechanism)
        return f"<figure>{shown}<figcaption>{escape(repr(self)[1:-1])}</figcaption></figure>"


def _body_columns(name: str, body: Any) -> Iterator[tuple[str, np.ndarray]]:
    for key, axes in (("orientation", "wxyz"), *((key, "xyz") for key in VECTORS)):
        if (array := getattr(body, key)) is not None:
            yield from ((f"{name}.{key}.{axis}", array[:, i]) for i, axis in enumerate(axes))


def _joint_columns(joint: JointMotion) -> Iterator[tuple[str, np.ndarray]]:
    for key in ("angle", "rate", "displacement", "open"):
        if (array := getattr(joint, key)) is not None:
            yield f"{joint.name}.{key}", array
    for key in ("force", "moment"):
        if (array := getattr(joint, key)) is not None:
            yield from ((f"{joint.name}.{key}.{axis}", array[:, i]) for i, axis in enumerate("xyz"))
