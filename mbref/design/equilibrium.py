"""Static equilibria and steady motions of a mechanism, their stability, and small vibrations about them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbref import rotations
from mbref.design.linearisation import OffConstraints, Tangent, multipliers, unsteady
from mbref.design.placed import placed_with_springs
from mbref.design.turning import Turning, turning
from mbref.equations.along_trajectory import without_armatures
from mbref.equations.initial_state import consistent_start, solve_positions
from mbref.equations.joint_reactions import reactions
from mbref.equations.model import Model, displaced, displacement
from mbref.input_error import InputError
from mbref.motion import Motion
from mbref.scene import Scene, SceneError
from mbref.scenes import find_scene

STARTS = 24  # number of poses from which an equilibrium is searched
STRIDE = 0.35  # distance of neighbouring starts / length of the mechanism
LONGEST_STEP = 0.3  # largest step towards an equilibrium / length of the mechanism
MOST_NEWTON_STEPS = 60  # largest number of Newton steps from a start
BALANCED = 1e-11  # largest acceleration at an equilibrium / scale of accelerations
SAME_EQUILIBRIUM = 1e-6  # distance / length of the mechanism, or rad, below which two poses count as equal
STILL_EIGENVALUE = 1e-6  # real part or eigenvalue / largest |s| below which it counts as zero
# acceleration × duration² / length of the mechanism below which a mechanism counts as free of forces
FORCE_FREE = 1e-9
# displayed vibration: largest displacement / length of the mechanism, and number of samples
AMPLITUDE, MODE_SAMPLES = 0.1, 49


@dataclass(frozen=True, repr=False)
class Equilibrium:
    """A pose at which a mechanism stays at rest, or turns with its driver as if it were one body.

    Attributes
    ----------
    scene : Scene
        The scene with its bodies at this pose, at rest or turning; springs, joints and loads are carried
        along.
    eigenvalues : ndarray, shape (2f,), complex
        Exponents s of small motions exp(s t), 1/s, of the f degrees of freedom.
    shapes : ndarray, shape (2f, nb, 6), complex
        Motion of each body for each eigenvalue: displacement of the centre of mass (m) and rotation vector
        (rad), world frame, relative to the turning mechanism. The largest is one length of the mechanism, or
        one radian, and real.
    reactions : dict of str to ndarray, shape (6,)
        Force (N) and moment (N m) on the second body of each joint at its anchor, world frame.
    rate : float
        Angular speed with which the mechanism turns, rad/s; zero at a static equilibrium.
    """

    scene: Scene
    eigenvalues: np.ndarray
    shapes: np.ndarray
    reactions: dict[str, np.ndarray]
    rate: float = 0.0

    @property
    def stability(self) -> str:
        """``stable``, ``unstable`` or ``indifferent``, by the largest real part of the eigenvalues."""
        size = float(np.abs(self.eigenvalues).max(initial=0.0))
        if size == 0.0 or np.abs(self.eigenvalues).min() < STILL_EIGENVALUE * size:
            return "indifferent"
        return "unstable" if self.eigenvalues.real.max() > STILL_EIGENVALUE * size else "stable"

    @property
    def frequencies(self) -> np.ndarray:
        """Undamped natural frequencies |s| / 2π, Hz, of the eigenvalues with positive imaginary part."""
        return np.asarray(np.abs(self.eigenvalues[self.oscillating]) / (2 * np.pi))

    @property
    def damping_ratios(self) -> np.ndarray:
        """Damping ratios -Re s / |s| of the eigenvalues s with positive imaginary part."""
        found = self.eigenvalues[self.oscillating]
        return np.asarray(-found.real / np.abs(found) + 0.0)

    @property
    def oscillating(self) -> np.ndarray:
        """Numbers (indices from 0) of the eigenvalues with positive imaginary part, slowest vibration
        first."""
        size = float(np.abs(self.eigenvalues).max(initial=0.0))
        return np.flatnonzero(self.eigenvalues.imag > STILL_EIGENVALUE * size)

    def __repr__(self) -> str:
        listed = ", ".join(f"{f:.6g} Hz" for f in self.frequencies)
        kind = "Steady motion" if self.rate else "Equilibrium"
        return f"<{kind} of {self.scene.name!r}: {self.stability}{'; ' * bool(listed)}{listed}>"


def equilibria(scene: Scene | str | Path, starts: int = STARTS) -> list[Equilibrium]:
    """Return the static equilibria, or steady motions, that are found from several starts.

    The starts are the scene's pose and poses that are reached from it along the constraints. There is no
    guarantee that all equilibria are found. Drivers must stand still. One driver may turn a body relative to
    the ground at a constant rate about an axis parallel to gravity: then the result has the steady motions
    in which the whole mechanism turns with it. From each start Levenberg's method (Quarterly of Applied
    Mathematics 2, 1944) reduces the accelerations to zero.

    Parameters
    ----------
    scene : Scene, str or path
        The mechanism, the name of a built-in one, or a .toml file.
    starts : int
        Number of starts.

    Returns
    -------
    list of Equilibrium
        Different equilibria, in the order in which they are found.

    Raises
    ------
    SceneError
        If a body has no mass, a driver or a load moves otherwise, or the mechanism has no degree of freedom.
    """
    scene = find_scene(scene).assembled()
    frame, model = _frame(scene), Model(scene)
    first = Tangent(model, consistent_start(model).q, frame)
    if reason := unsteady(first):
        raise SceneError([f"driver[{frame.joint}]: {reason}, so the motion is not steady"])
    poses = list(_starts(first, starts))
    scale = _scale(poses)
    if scale <= FORCE_FREE * model.length / scene.duration**2:
        return [_equilibrium(poses[0])]
    found: list[Tangent] = []
    for tangent in poses:
        settled = _balanced(tangent, scale)
        if settled is not None and not any(_is_same(settled, other) for other in found):
            found.append(settled)
    return [_equilibrium(tangent) for tangent in found]


def motion_of_mode(equilibrium: Equilibrium, number: int, amplitude: float = AMPLITUDE) -> Motion:
    """Return one period of a vibration about an equilibrium, without damping, on the constraints.

    Parameters
    ----------
    equilibrium : Equilibrium
        An equilibrium with vibrations.
    number : int
        Number of the vibration in ``frequencies``, from 1.
    amplitude : float
        Largest displacement, in lengths of the mechanism.

    Returns
    -------
    Motion
        Poses over one period, s; velocities are zero.

    Raises
    ------
    InputError
        If there is no such vibration.
    """
    if not 1 <= number <= len(equilibrium.oscillating):
        raise InputError(
            f"mode: there are {len(equilibrium.oscillating)} vibrations, there is none with number {number}"
        )
    which = equilibrium.oscillating[number - 1]
    model, shape = Model(without_armatures(equilibrium.scene)), equilibrium.shapes[which]
    q = model.start()
    turned = rotations.conjugate(q.reshape(model.nb, 7)[: len(shape), 3:])
    poses, phases = [], np.linspace(0.0, 2 * np.pi, MODE_SAMPLES)
    for phase in phases:
        x = np.zeros((model.nb, 6))
        x[: len(shape)] = amplitude * (shape * np.exp(1j * phase)).real
        x[: len(shape), 3:] = rotations.rotate(turned, x[: len(shape), 3:])
        poses.append(solve_positions(model, 0.0, displaced(q, x.ravel()))[0])
    times = phases / abs(equilibrium.eigenvalues[which])
    places = np.array(poses).reshape(MODE_SAMPLES, model.nb, 7)
    still = np.zeros((MODE_SAMPLES, model.nb, 6))
    found = model.motion(places, still, still)
    names = tuple(body.name for body in equilibrium.scene.body)
    return Motion(
        equilibrium.scene.name, "mbref", "", "mode", {}, times, names, **found, mechanism=equilibrium.scene
    )


def _frame(scene: Scene) -> Turning:
    """Return the frame in which the scene can rest; raises SceneError if there is none."""
    if not scene.has_mass():
        without = next(body.name for body in scene.body if body.mass is None)
        raise SceneError([f"body[{without}].mass: is missing; an equilibrium needs the mass of every body"])
    for k, load in enumerate(scene.load):
        if load.over_time and not load.over_time.is_constant:
            raise SceneError([f"load[{k}].factor: varies; an equilibrium needs loads that stay the same"])
    frame = turning(scene)
    if scene.counts().degrees_of_freedom == 0:
        raise SceneError(["the mechanism has no degree of freedom, so it rests at any load"])
    return frame


def _scale(poses: list[Tangent]) -> float:
    """Return the scale of accelerations, m/s²: the largest acceleration at some poses, or the acceleration
    for a displacement by the mechanism's length."""
    by_place = float(np.linalg.norm(poses[0].slope())) * poses[0].model.length
    return max(by_place, *(float(np.linalg.norm(each.accelerations(*_rest(each)))) for each in poses))


def _rest(tangent: Tangent) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(tangent.freedoms), np.zeros(tangent.freedoms)


def _starts(first: Tangent, count: int) -> Iterator[Tangent]:
    """Yield the first pose, and further poses along the constraints in random directions with a fixed
    seed."""
    rng, freedoms = np.random.default_rng(1), first.freedoms
    yield first
    there = back = first
    direction = rotations.unit(rng.standard_normal(freedoms))
    for k in range(1, count):
        forth = k % 2 == 1
        tangent = there if forth else back
        ahead = tangent.basis.T @ first.basis @ direction
        sign = 1.0 if forth else -1.0
        moved = _moved(tangent, sign * STRIDE * first.model.length * rotations.unit(ahead))
        if moved is None or moved.freedoms != freedoms:
            direction = rotations.unit(rng.standard_normal(freedoms))
            continue
        there, back = (moved, back) if forth else (there, moved)
        direction = (
            rotations.unit(direction + 0.3 * rng.standard_normal(freedoms)) if freedoms > 1 else direction
        )
        yield moved


def _balanced(tangent: Tangent, scale: float) -> Tangent | None:
    """Return the pose near a start without accelerations, by Levenberg's method; None if no such pose is
    found."""
    freedoms, damping = tangent.freedoms, 0.0
    off = tangent.accelerations(*_rest(tangent))
    for _ in range(MOST_NEWTON_STEPS):
        if np.linalg.norm(off) <= BALANCED * scale:
            return _refined(tangent, off)
        try:
            slope = tangent.slope()
        except OffConstraints:
            return None
        weight = damping * float(np.linalg.norm(slope)) ** 2 + 1e-300
        step = -np.linalg.lstsq(slope.T @ slope + weight * np.eye(freedoms), slope.T @ off, rcond=None)[0]
        size = float(np.linalg.norm(step)) / (LONGEST_STEP * tangent.model.length)
        moved = _moved(tangent, step / max(1.0, size))
        after = off if moved is None else moved.accelerations(*_rest(moved))
        if moved is None or moved.freedoms != freedoms or np.linalg.norm(after) >= np.linalg.norm(off):
            damping = max(10 * damping, 1e-3)
            if damping > 1e6:
                return None
            continue
        tangent, off, damping = moved, after, damping / 10
    return None


def _refined(tangent: Tangent, off: np.ndarray) -> Tangent:
    """Return the pose after one more Newton step, if that is better: exponents near each other need it."""
    try:
        slope = tangent.slope()
    except OffConstraints:
        return tangent
    moved = _moved(tangent, -np.linalg.lstsq(slope, off, rcond=None)[0])
    if moved is None or moved.freedoms != tangent.freedoms:
        return tangent
    return moved if np.linalg.norm(moved.accelerations(*_rest(moved))) < np.linalg.norm(off) else tangent


def _moved(tangent: Tangent, y: np.ndarray) -> Tangent | None:
    try:
        return Tangent(tangent.model, tangent.pose(y), tangent.frame)
    except OffConstraints:
        return None


def _is_same(first: Tangent, second: Tangent) -> bool:
    apart = displacement(first.q, second.q) / first.units
    return bool(np.abs(apart).max(initial=0.0) < SAME_EQUILIBRIUM * first.model.length)


def _equilibrium(tangent: Tangent) -> Equilibrium:
    model, freedoms = tangent.model, tangent.freedoms
    by_place, by_rate = tangent.linear_part()
    first_order = np.block([[np.zeros((freedoms, freedoms)), np.eye(freedoms)], [by_place, by_rate]])
    values, vectors = np.linalg.eig(first_order)
    order = np.lexsort((-values.imag, np.abs(values).round(12)))
    shapes = (tangent.units[:, None] * (tangent.basis @ vectors[:freedoms, order])).T
    shapes = shapes.astype(complex).reshape(len(order), model.nb, 6)[:, : len(model.scene.body)]
    turned = tangent.q.reshape(model.nb, 7)[: len(model.scene.body), 3:]
    for part in (shapes.real, shapes.imag):
        part[..., 3:] = rotations.rotate(turned, part[..., 3:])
    in_units = (shapes / np.repeat([model.length, 1.0], 3)).reshape(len(order), -1)
    # the shape is scaled such that this entry becomes 1
    largest = in_units[np.arange(len(order)), np.abs(in_units).argmax(axis=1)]
    q = tangent.q.reshape(1, model.nb, 7)
    forces = reactions(model, q, model.terms(np.zeros(1), q).blocks, multipliers(tangent)[None])
    scene = placed_with_springs(model, tangent.q)
    return Equilibrium(
        scene.with_(body=tangent.frame.bodies(scene)),
        values[order],
        shapes / largest[:, None, None],
        {name: wrench[0] for name, wrench in forces.items()},
        tangent.frame.rate,
    )
