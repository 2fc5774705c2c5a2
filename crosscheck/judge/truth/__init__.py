"""Truths: exact motions. Families of mechanisms with closed forms are recognised from their data; other
scenes have references.

A truth is a closed form, a high-precision solution of an equation reduced to the true degrees of freedom, or
the reference that two formulations agree on; it shares no code with the engines that it judges.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Protocol

import numpy as np

from crosscheck.judge.pieces import has_pieces
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.start import started
from crosscheck.judge.time_functions import ends
from crosscheck.judge.truth.crankshaft import crankshaft
from crosscheck.judge.truth.free_body import free_body
from crosscheck.judge.truth.locked import locked
from crosscheck.judge.truth.one_dof import Path, one_dof
from crosscheck.judge.truth.parallelogram import parallelogram
from crosscheck.judge.truth.picard import NoSolution
from crosscheck.judge.truth.planar_slider_crank import planar_slider_crank
from crosscheck.judge.truth.reference_truth import ReferenceTruth
from crosscheck.judge.truth.slider import slider
from crosscheck.judge.truth.spatial_slider_crank import spatial_slider_crank
from mbref.motions.trajectory import Trajectory
from mbref.scene import JointLoad, Scene, TorsionSpring, rolling_wheel

PATHS: tuple[Callable[[Scene], Path | None], ...] = (
    parallelogram,
    planar_slider_crank,
    crankshaft,
    spatial_slider_crank,
    slider,
)


__all__ = ["NoSolution", "Truth", "closed_form", "truth_for"]


class Truth(Protocol):
    """Interface of the exact motion of one scene.

    Attributes
    ----------
    name : str
        Name of the family of closed forms, or "reference".
    accuracy : float
        Bound on the error of the poses, relative to the scene's length and to the angle turned.
    """

    @property
    def name(self) -> str:
        """Name of the family of closed forms, or "reference"."""

    @property
    def accuracy(self) -> float:
        """Bound on the error of the poses, relative to the scene's length and to the angle turned."""

    def poses(self, times: np.ndarray) -> Trajectory:
        """Return poses, velocities and accelerations.

        Parameters
        ----------
        times : ndarray, shape (k,)
            Sample times ≥ 0, s.

        Returns
        -------
        Trajectory
            States at the times, in the frames and units of Trajectory.

        Raises
        ------
        NoSolution
            If the motion is not known up to the last time.
        """


def truth_for(scene: Scene, reference_time: float = SECONDS) -> Truth | None:
    """Return the truth of a scene.

    Parameters
    ----------
    scene : Scene
        The mechanism.
    reference_time : float
        CPU time (s) that a reference solution may take when ``poses`` is called first. Zero allows closed
        forms only.

    Returns
    -------
    Truth or None
        A closed form if the scene's family is known, otherwise a reference solution. None without either.
    """
    scene = started(scene)
    return closed_form(scene) or (ReferenceTruth(scene, reference_time) if reference_time else None)


@functools.lru_cache(maxsize=64)
def closed_form(scene: Scene) -> Truth | None:
    """Return the truth of a scene of a known family, or None. The truth is cached with the part of the motion
    that is already solved.

    No known family has couplings, intervals, armatures, rolling wheels, tables, driven orientations, loads
    over time or, except torsion springs, loads of joints.
    """
    varies = any(load.over_time for load in scene.load) or any(
        ends(driver) or driver.turn for driver in scene.driver
    )
    pushed = any(isinstance(load, JointLoad) and not isinstance(load, TorsionSpring) for load in scene.load)
    others = varies or pushed or scene.coupling or has_pieces(scene) or rolling_wheel(scene)
    if others or any(joint.reflected_inertia for joint in scene.joint):
        return None
    for family in PATHS:
        if truth := one_dof(scene, family(scene)):
            return truth
    return free_body(scene) or locked(scene)
