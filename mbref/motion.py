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
    """A trajectory together with its scene: joints, energies, tables, files and pictures.

    ``motion["rod"].position`` is the motion of a body, ``motion.joint("A").angle`` of a joint. All attributes
    of Trajectory are present.

    Attributes
    ----------
    mechanism : Scene
        The scene that moves.
    """

    mechanism: Scene = field(kw_only=True)

    @staticmethod
    def of(scene: Scene, trajectory: Trajectory) -> Motion:
        """Return the trajectory of any engine together with its scene."""
        return Motion(**{f.name: getattr(trajectory, f.name) for f in fields(Trajectory)}, mechanism=scene)

    def joint(self, name: str) -> JointMotion:
        """Return angle, displacement and reaction of one joint.

        Raises
        ------
        KeyError
            If no joint has this name; the message lists the joints.
        """
        return joint_motion(self.mechanism, self, name)

    @property
    def kinetic_energy(self) -> np.ndarray:
        """Kinetic energy, J, shape (k,). Raises ValueError if a body has no mass."""
        return kinetic(self.mechanism, self)

    @property
    def potential_energy(self) -> np.ndarray:
        """Energy of gravity, springs and torsion springs, J, shape (k,).

        Raises ValueError if a body has no mass.
        """
        return potential(self.mechanism, self)

    @property
    def energy(self) -> np.ndarray:
        """Kinetic plus potential energy, J, shape (k,).

        It is constant if the scene has no drivers, dampers, forces and moments.
        """
        return self.kinetic_energy + self.potential_energy

    def columns(self) -> dict[str, np.ndarray]:
        """Return every number over time as a column.

        Returns
        -------
        dict of str to ndarray, shape (k,)
            ``time``, ``rod.position.x``, ``A.angle``, ``energy`` and so on, in SI units.
        """
        table = {"time": self.times}
        for name in self.bodies:
            table.update(_body_columns(name, self[name]))
        for joint in self.mechanism.joint:
            table.update(_joint_columns(self.joint(joint.name)))
        if self.mechanism.has_mass():
            table["energy"] = self.energy
        return table

    def to_dataframe(self) -> Any:
        """Return the columns as a pandas DataFrame, indexed by time.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("to_dataframe needs pandas: pip install pandas; columns() does not") from None
        return pandas.DataFrame(self.columns()).set_index("time")

    def to_csv(self, path: str | Path) -> None:
        """Write the columns as CSV. The first line has their names, numbers have all digits."""
        table = self.columns()
        with open(path, "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(table)
            writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))

    def save(self, path: str | Path) -> None:
        """Write scene and trajectory as one JSON object, which ``Motion.load`` reads.

        Raises
        ------
        ValueError
            If the file's name does not end in ``.json``.
        """
        if Path(path).suffix.lower() != ".json":
            raise ValueError(f"{path}: a motion is saved as .json; for a picture use animate or plot")
        whole = {"scene": self.mechanism.to_dict(), "record": self.to_record()}
        Path(path).write_text(strict_json(whole) + "\n", encoding="utf-8")

    @staticmethod
    def load(path: str | Path) -> Motion:
        """Read a file that ``Motion.save`` wrote.

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError
            If the file holds something else.
        """
        try:
            whole = json.loads(Path(path).read_text(encoding="utf-8"))
            scene = Scene(**whole["scene"])
            return Motion.of(scene, Trajectory.from_record(scene.name, whole["record"]))
        except (ValueError, KeyError, TypeError, AttributeError, SceneError):
            raise ValueError(f"{path}: is not a file that Motion.save wrote") from None

    def plot(self, *names: str) -> Any:
        """Plot columns over time, one panel for each quantity.

        Parameters
        ----------
        *names : str
            Columns or their beginnings, such as ``"rod.position"``. Default: joint coordinates and energy.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        ValueError
            If a name fits no column.
        ImportError
            If matplotlib is not installed.
        """
        from mbref.drawing.plot import plot

        return plot(self.columns(), names)

    def picture(self, view: str | None = None) -> str:
        """Return the moving mechanism as SVG.

        Parameters
        ----------
        view : str, optional
            ``"xy"``, ``"xz"``, ``"yz"``, ``"oblique"`` or ``"AZIMUTH,ELEVATION"`` in degrees.
        """
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
