"""Motion: a trajectory together with its scene, from which joint motions, energies, tables, files and
pictures follow."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from mbref.actuation import DriverMotion, LoadMotion, driver_motion, load_motion
from mbref.drawing.picture import moving, still
from mbref.drawing.view import View
from mbref.energy import kinetic, potential
from mbref.error_estimate import ErrorEstimate
from mbref.joint_motion import JointMotion, joint_motion
from mbref.outputs import chosen, columns_of
from mbref.records import strict_json
from mbref.scene import Scene, SceneError
from mbref.scene_services import SERVICES, Violation
from mbref.trajectory import Trajectory


@dataclass(frozen=True, repr=False)
class Motion(Trajectory):
    """A trajectory together with its scene, from which joint motions, energies, tables, files and pictures
    follow.

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

        The energy is constant if the scene has no drivers, dampers, forces and moments.
        """
        return self.kinetic_energy + self.potential_energy

    def driver(self, joint: str) -> DriverMotion:
        """Return force or torque, and power that the driver of a joint supplies.

        Raises
        ------
        KeyError
            If the joint has no driver; the message lists the driven joints.
        """
        return driver_motion(self.mechanism, self, joint)

    def load_at(self, place: int) -> LoadMotion:
        """Return length or angle, rate, force or torque, and power of a load, given by its index in the scene
        from 0.

        Raises
        ------
        IndexError
            If the scene has no such load.
        """
        return load_motion(self.mechanism, self, place)

    @property
    def violation(self) -> Violation:
        """Largest violation of a constraint row at position, velocity and acceleration level."""
        return SERVICES.violations(self.mechanism, self)

    @property
    def largest_reaction(self) -> np.ndarray | None:
        """Largest reaction force of a joint at each sample, N, shape (k,). None if a body has no mass."""
        if self.reactions is None:
            return None
        forces = [np.linalg.norm(wrench[:, :3], axis=1) for wrench in self.reactions.values()]
        return np.asarray(np.max(forces, axis=0, initial=0.0)) if forces else np.zeros(len(self.times))

    @property
    def determined_reactions(self) -> dict[str, np.ndarray]:
        """Components of the reactions that equilibrium determines, by joint, shape (k, 6). An entry is true
        for a component of force (x, y, z) or moment (x, y, z) that does not depend on how redundant
        constraints share the load. In a plane mechanism across z these are force x, force y and moment z.
        """
        return SERVICES.determined_reactions(self.mechanism, self)

    @cached_property
    def error_estimate(self) -> ErrorEstimate:
        """Estimated global error of the motion at its samples, by a second run at a smaller tolerance.

        The second run is made on first access and takes about twice the time of the motion. Raises ValueError
        if the motion is of another engine than mbref.
        """
        return SERVICES.error_estimate(self)

    def with_error_estimate(
        self, seconds: float = math.inf, progress: Callable[[float], None] | None = None
    ) -> Motion:
        """Return the motion with its error estimate. The estimate's warning, if any, is part of ``message``.

        Parameters
        ----------
        seconds : float
            Time limit, s. No estimate is made of a motion whose steps took longer, and none by a second run
            that takes longer; ``error_estimate.reason`` is then the reason.
        progress : callable, optional
            Called with the time reached (s) between steps of the second run.

        Raises
        ------
        ValueError
            If the motion is of another engine than mbref.
        """
        estimate = SERVICES.error_estimate(self, seconds, progress)
        message = "; ".join(filter(None, (self.message, estimate.warning)))
        return replace(self, message=message)._keeping(estimate)

    def _keeping(self, estimate: ErrorEstimate) -> Motion:
        """Return the motion with the given error estimate."""
        self.__dict__["error_estimate"] = estimate
        return self

    @property
    def known_estimate(self) -> ErrorEstimate | None:
        """Error estimate, or None if no estimate has been made."""
        return self.__dict__.get("error_estimate")

    def to_record(self) -> dict[str, Any]:
        """Return the record that ``run --json`` prints; ``error_estimate`` is None if none was made."""
        estimate = self.known_estimate
        return {**super().to_record(), "error_estimate": estimate and estimate.to_record()}

    def columns(self, *names: str) -> dict[str, np.ndarray]:
        """Return numbers over time as columns.

        Parameters
        ----------
        *names : str
            Columns or their beginnings, such as ``"rod.position"`` or ``"driver(A).torque"``. Default: all.
            ``mbref list outputs`` prints the names.

        Returns
        -------
        dict of str to ndarray, shape (k,)
            ``time``, ``rod.position.x``, ``A.angle``, ``energy`` and so on, in SI units. ``error_estimate``
            is among them if it has been made.

        Raises
        ------
        ValueError
            If a name fits no column.
        """
        table = {"time": self.times}
        for name in self.bodies:
            table.update(columns_of("body", name, vars(self[name])))
        for joint in self.mechanism.joint:
            table.update(columns_of("joint", joint.name, vars(self.joint(joint.name))))
        for driver in self.mechanism.driver:
            table.update(columns_of("driver", driver.joint, vars(self.driver(driver.joint))))
        for place in range(len(self.mechanism.load)):
            table.update(columns_of("load", str(place), vars(self.load_at(place))))
        table.update(columns_of("mechanism", "", self._totals()))
        return {name: table[name] for name in ["time", *chosen(table, names)]} if names else table

    def _totals(self) -> dict[str, np.ndarray | None]:
        """Numbers of the whole mechanism by their names in the table of outputs."""
        levels = {f"{level}_violation": rows for level, rows in self.violation._asdict().items()}
        energies = ("kinetic_energy", "potential_energy", "energy") if self.mechanism.has_mass() else ()
        found = {name: getattr(self, name) for name in energies}
        estimate = None if self.known_estimate is None else self.known_estimate.error
        return {**levels, "largest_reaction": self.largest_reaction, **found, "error_estimate": estimate}

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

    def to_csv(self, path: str | Path, *names: str) -> None:
        """Write columns, by default all, as CSV. The first line has their names, numbers have all digits."""
        table = self.columns(*names)
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
            scene, record = Scene(**whole["scene"]), whole["record"]
            motion = Motion.of(scene, Trajectory.from_record(scene.name, record))
            estimate = record.get("error_estimate")
            return motion._keeping(ErrorEstimate.from_record(motion.times, estimate)) if estimate else motion
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
