"""Motion: a trajectory and its scene, from which joint motions, energies, tables and pictures follow."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from mbref.motions.actuation import DriverMotion, LoadMotion, driver_motion, largest_force, load_motion
from mbref.motions.body_order import fields_in_order
from mbref.motions.constraints import Violation, determined_reactions, violations
from mbref.motions.drawing.picture import moving, still
from mbref.motions.drawing.plot import plot
from mbref.motions.drawing.view import View
from mbref.motions.energy import kinetic, potential
from mbref.motions.error_estimate import ErrorEstimate
from mbref.motions.files import dataframe, read_json, write_csv, write_json
from mbref.motions.joint_motion import JointMotion, joint_motion
from mbref.motions.maxima import ReactionMaxima, reaction_maxima
from mbref.motions.motor_motion import MotorMotion
from mbref.motions.output_units import in_units
from mbref.motions.outputs import all_columns, chosen_columns
from mbref.motions.restart_with_events import restarted
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Trajectory):
    """A trajectory, with all its attributes, and its scene: ``motion["rod"]``, ``motion.joint("A")``.

    Attributes
    ----------
    mechanism : Scene
        The scene that moves.
    error_estimate : ErrorEstimate or None
        Estimated global error at the samples, which ``mbref.with_error_estimate`` adds. None before.
    motors : dict of str to MotorMotion
        By joint, forces or torques of motors, which ``mbref.inverse_dynamics`` adds; files lack them.
    """

    mechanism: Scene = field(kw_only=True)
    error_estimate: ErrorEstimate | None = None
    motors: dict[str, MotorMotion] = field(default_factory=dict)

    @staticmethod
    def of(scene: Scene, trajectory: Trajectory) -> Motion:
        """Return the trajectory of any engine together with its scene, which outputs such as ``joint`` need.

        Parameters
        ----------
        scene : Scene
            The scene that moves.
        trajectory : Trajectory
            Its motion, with the bodies in any order; the result has the scene's order.
        """
        return Motion(**fields_in_order(scene, trajectory), mechanism=scene)

    def joint(self, name: str) -> JointMotion:
        """Return angle (rad), displacement (m), their rates and the reaction (N, N m) of one joint.

        Parameters
        ----------
        name : str
            Name of the joint.

        Raises
        ------
        KeyError
            If no joint has this name; the message lists the joints.
        """
        return joint_motion(self.mechanism, self, name)

    @property
    def kinetic_energy(self) -> np.ndarray:
        """Kinetic energy, J, shape (k,). Raises InputError if a body has no mass."""
        return kinetic(self.mechanism, self)

    @property
    def potential_energy(self) -> np.ndarray:
        """Energy of gravity and springs, J, shape (k,). Raises InputError if a body has no mass."""
        return potential(self.mechanism, self)

    @property
    def energy(self) -> np.ndarray:
        """Kinetic plus potential energy, J, shape (k,), constant without drivers, dampers and forces."""
        return self.kinetic_energy + self.potential_energy

    def scene_at(self, t: float) -> Scene:
        """Return the scene that starts with the state at a sample time, and then moves as this motion.

        Its time counts from t: drivers and factors of loads are shifted (a load that has ended has the factor
        0), natural values of springs at joints count from the new poses, and couplings have no offsets.

        Parameters
        ----------
        t : float
            A sample time, s.

        Returns
        -------
        Scene
            With the remaining duration.

        Raises
        ------
        InputError
            If the motion has no sample at t; the message has the nearest one. If a joint with intervals
            engages later and has to meet a given pose, or has axes on both bodies.
        """
        return restarted(self.mechanism, self, t)

    def driver(self, joint: str) -> DriverMotion:
        """Return force (N) or torque (N m), and power (W), that the driver of a joint supplies.

        Parameters
        ----------
        joint : str
            Name of the driven joint.

        Raises
        ------
        KeyError
            If the joint has no driver; the message lists the driven joints.
        """
        return driver_motion(self.mechanism, self, joint)

    def load_at(self, place: int) -> LoadMotion:
        """Return length (m) or angle (rad), rate, force (N) or torque (N m), and power (W) of one load.

        Parameters
        ----------
        place : int
            Index of the load in the scene, from 0.

        Raises
        ------
        IndexError
            If the scene has no such load.
        """
        return load_motion(self.mechanism, self, place)

    @property
    def impulses(self) -> dict[str, np.ndarray]:
        """Impulses at the events, by joint, shape (events, 6): force (N s) and moment (N m s) on the second
        body at its anchor, world frame; zero where a joint does not hold. Empty without events."""
        names, found = [joint.name for joint in self.mechanism.joint], [e.impulses for e in self.events or ()]
        return {name: np.array([each.get(name, np.zeros(6)) for each in found]) for name in names if found}

    @property
    def violation(self) -> Violation:
        """Largest violation of a constraint row at position, velocity and acceleration level."""
        return violations(self.mechanism, self)

    @property
    def largest_reaction(self) -> np.ndarray | None:
        """Largest reaction force of a joint at each sample, N, shape (k,). None if a body has no mass."""
        return largest_force(self)

    @property
    def determined_reactions(self) -> dict[str, np.ndarray]:
        """Components of the reactions that equilibrium determines, by joint, shape (k, 6). An entry is true
        for a component of force (x, y, z) or moment (x, y, z), world axes, that does not depend on how
        redundant constraints share the load: in a plane across z force x, force y and moment z."""
        return determined_reactions(self.mechanism, self)

    def to_record(self) -> dict[str, Any]:
        """Return the record of ``Trajectory.to_record`` with ``error_estimate``: a dict, or None without an
        estimate. ``run --json`` prints it."""
        estimate = self.error_estimate
        return {**super().to_record(), "error_estimate": estimate and estimate.to_record()}

    def columns(self, *names: str, units: str | None = None) -> dict[str, np.ndarray]:
        """Return numbers over time as columns.

        Parameters
        ----------
        *names : str
            Columns or their beginnings, such as ``"rod.position"`` or ``"driver(A).torque"``. Default: all.
            ``mbref list outputs`` prints the names.
        units : str, optional
            Units such as ``"mm,deg"``; other numbers are in SI units. Every name then has its unit, as
            ``rod.position.x [mm]``; so ``""`` adds the SI units. Default: SI units, names without units.

        Returns
        -------
        dict of str to ndarray, shape (k,)
            ``time``, ``rod.position.x``, ``A.angle``, ``energy`` and so on.

        Raises
        ------
        InputError
            If a name fits no column, or a unit is unknown.
        """
        found = chosen_columns(self, names) if names else all_columns(self)
        return found if units is None else in_units(found, units)

    def reaction_maxima(self) -> dict[str, ReactionMaxima]:
        """Return the largest force and moment of each joint among the samples, with their times.

        Returns
        -------
        dict of str to ReactionMaxima
            By joint. Empty if a body has no mass, or without samples.
        """
        return reaction_maxima(self)

    def to_dataframe(self, *names: str, units: str | None = None) -> Any:
        """Return columns as a pandas DataFrame, indexed by time.

        Parameters
        ----------
        *names : str
            Columns or their beginnings, as for ``columns``, with its error. Default: all.
        units : str, optional
            Units, as for ``columns``.

        Returns
        -------
        pandas.DataFrame, shape (k, columns)

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return dataframe(self.columns(*names, units=units))

    def to_csv(
        self, path: str | Path, *names: str, units: str | None = None, decimal_comma: bool = False
    ) -> None:
        """Write columns as CSV. The first line has their names, numbers have all digits.

        Parameters
        ----------
        path : str or path
            The file.
        *names : str
            Columns or their beginnings, as for ``columns``, with its error. Default: all.
        units : str, optional
            Units, as for ``columns``; the first line then has them.
        decimal_comma : bool
            Whether numbers have a decimal comma, and ``;`` stands between them.
        """
        write_csv(path, self.columns(*names, units=units), decimal_comma)

    def save(self, path: str | Path) -> None:
        """Write scene and trajectory as one JSON object, which ``Motion.load`` reads.

        Parameters
        ----------
        path : str or path
            The file, which ends in ``.json``.

        Raises
        ------
        InputError
            If the file's name does not end in ``.json``.
        """
        write_json(path, self.mechanism, self.to_record())

    @staticmethod
    def load(path: str | Path) -> Motion:
        """Return the motion in a file that ``Motion.save`` wrote.

        Parameters
        ----------
        path : str or path
            The file.

        Raises
        ------
        OSError, InputError
            If the file cannot be read, or contains no saved motion.
        """
        scene, trajectory, estimate = read_json(path)
        return replace(Motion.of(scene, trajectory), error_estimate=estimate)

    def plot(
        self, *names: str, over: str = "time", units: str = "", together: bool = False, ax: Any = None
    ) -> Any:
        """Plot columns over time, one panel for each quantity; ``mbref.plot`` with one motion.

        Parameters
        ----------
        *names : str
            Columns or their beginnings, such as ``"rod.position"``. Default: joint coordinates and energy.
        over : str
            Column of the horizontal axis, such as ``"A.angle"`` of a driven joint. Default: time.
        units : str
            Units such as ``"mm,deg"``. Default: SI.
        together : bool
            Whether all columns of one unit share a panel.
        ax : matplotlib.axes.Axes, optional
            Axes to draw in, for columns of one panel. Default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure or matplotlib.axes.Axes
            The new figure, or ``ax``.

        Raises
        ------
        InputError, ImportError
            If a name fits no column, or matplotlib is not installed.
        """
        return plot(self, *names, over=over, units=units, together=together, ax=ax)

    def picture(self, view: str | None = None) -> str:
        """Return the moving mechanism as the text of an animated SVG.

        Parameters
        ----------
        view : str, optional
            ``"xy"``, ``"xz"``, ``"yz"``, ``"oblique"`` or ``"AZIMUTH,ELEVATION"`` in degrees.

        Raises
        ------
        InputError
            If the view is unknown, or the motion has no sample.
        """
        return moving(self.mechanism, self, View.parse(view) if view else None)

    def _repr_html_(self) -> str:
        shown = self.picture() if self.times.size else still(self.mechanism)
        return f"<figure>{shown}<figcaption>{escape(repr(self)[1:-1])}</figcaption></figure>"
