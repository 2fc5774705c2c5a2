"""Static equilibria and steady motions of a mechanism, their stability, and small vibrations about them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mbref import rotations
from mbref.design.balance import ONE_POSE, Newton, are_one, balanced
from mbref.design.falling import fallen
from mbref.design.joint_angles import slots
from mbref.design.linearisation import Tangent, multipliers, unsteady
from mbref.design.meeting_ends import refuse_meeting_ends
from mbref.design.stability import eigenvalues_of, linear_at
from mbref.design.starts import starts_from
from mbref.design.turning import Turning, turning
from mbref.design.winding import wound
from mbref.design.windings import Windings
from mbref.equations.driver_conflicts import refuse_conflict
from mbref.equations.initial_state import consistent_start, solve_positions
from mbref.equations.joint_angles import angles_by_joint
from mbref.equations.joint_reactions import reactions
from mbref.equations.model import Model, displaced
from mbref.equations.offsets import assembled
from mbref.equations.placed import placed_with_springs
from mbref.input_error import InputError
from mbref.motions.constraints import without_armatures
from mbref.motions.motion import Motion
from mbref.scene import Scene, SceneError, refuse_rolling, refuse_turned
from mbref.scenes import find_scene

STARTS = 24  # number of poses from which an equilibrium is searched
# smallest singular value / its largest value at the starts, below which a pose is a singular position
SINGULAR_POSE = 1e-5
# distance, lengths or rad, of random displacements that show the number of freedoms; their number
ASIDE, TRIALS = 0.02, 4
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
        Exponents s of small motions exp(s t), 1/s, of the f degrees of freedom. None at a singular position.
        Real and imaginary parts within the bound are zero.
    shapes : ndarray, shape (2f, nb, 6), complex
        Motion of each body for each eigenvalue: displacement of the centre of mass (m) and rotation vector
        (rad), world frame, relative to the turning mechanism. The largest is one length of the mechanism, or
        one radian, and real.
    reactions : dict of str to ndarray, shape (6,)
        Force (N) and moment (N m) on the second body of each joint at its anchor, world frame.
    rate : float
        Angular speed with which the mechanism turns, rad/s; zero at a static equilibrium.
    bounds : ndarray, shape (2f,)
        Largest error of each eigenvalue, 1/s: by its condition and the errors of the linearised equations.
    """

    scene: Scene
    eigenvalues: np.ndarray
    shapes: np.ndarray
    reactions: dict[str, np.ndarray]
    rate: float = 0.0
    bounds: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def is_singular(self) -> bool:
        """True at a singular position, where the number of freedoms is not defined."""
        return len(self.eigenvalues) == 0

    @property
    def stability(self) -> str:
        """``stable``, ``unstable``, ``indifferent`` or ``singular``.

        An eigenvalue with a positive real part makes the pose unstable, otherwise a zero eigenvalue makes it
        indifferent.
        """
        if self.is_singular:
            return "singular"
        if (self.eigenvalues.real > 0.0).any():
            return "unstable"
        return "indifferent" if (self.eigenvalues == 0.0).any() else "stable"

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
        """Indices (from 0) of the eigenvalues with positive imaginary part, shape (number of vibrations,),
        slowest vibration first."""
        return np.flatnonzero(self.eigenvalues.imag > 0.0)

    def __repr__(self) -> str:
        listed = ", ".join(f"{f:.6g} Hz" for f in self.frequencies)
        kind = "Steady motion" if self.rate else "Equilibrium"
        return f"<{kind} of {self.scene.name!r}: {self.stability}{'; ' * bool(listed)}{listed}>"


def equilibria(scene: Scene | str | Path, starts: int = STARTS) -> list[Equilibrium]:
    """Return the static equilibria, or steady motions, that are found from several starts.

    The starts are the scene's pose and poses that are reached from it along the constraints. There is no
    guarantee that all equilibria are found. Drivers must stand still. One driver may turn a body relative to
    the ground at a constant rate about an axis parallel to gravity: then the result has the steady motions
    in which the whole mechanism turns with it. From each start Newton's method looks for a pose at which
    nothing accelerates. Equilibria that are connected by equilibria are one.

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
        If a body has no mass, a driver or a load moves otherwise, the mechanism has no degree of freedom, or
        the ends of a damped spring meet and can part in more than one direction.
    """
    scene = assembled(find_scene(scene))
    refuse_rolling(scene, "equilibria and their modes")
    refuse_turned(scene, "equilibria and their modes")
    refuse_conflict(scene)
    frame = _frame(scene)
    model = Model(frame.with_armature(scene, 0.0))
    first = Tangent(model, consistent_start(model).q, frame, np.zeros(slots(model)))
    if first.freedoms == 0:
        driven = " and ".join(f"driver[{driver.joint}]" for driver in scene.driver)
        cause = f"without {driven} it can move" if driven else "it rests at any load"
        raise SceneError([f"the mechanism has no degree of freedom: {cause}"])
    if reason := unsteady(first):
        raise SceneError([f"driver[{frame.joint}]: {reason}, so the motion is not steady"])
    freedoms = _freedoms(first)
    poses = _poses(first, freedoms, starts)
    regular = max(each.conditioning for each in poses)
    found: list[Newton] = []
    for tangent in poses:
        settled = _settled(tangent, freedoms, found)
        if settled is not None and not any(_is_known(settled, other) for other in found):
            found.append(settled)
    for settled in fallen(found, first, freedoms, starts - 1):
        if not any(_is_known(settled, other) for other in found):
            found.append(settled)
    Windings(found, freedoms, _is_known).search()
    return [
        _equilibrium(each, each.tangent.conditioning < SINGULAR_POSE * regular, freedoms) for each in found
    ]


def _freedoms(first: Tangent) -> int:
    """Return the number of freedoms near a pose, which a singular position exceeds."""
    rng, found = np.random.default_rng(2), first.freedoms
    for _ in range(TRIALS):
        direction = first.basis.T @ rng.standard_normal(first.model.n)
        aside = first.moved(ASIDE * direction / np.linalg.norm(first.basis @ direction))
        if aside is not None:
            found = min(found, aside.freedoms)
    return found


def _poses(first: Tangent, freedoms: int, count: int) -> list[Tangent]:
    """Return the poses from which equilibria are searched; half of them where torsion springs are relaxed, if
    they are twisted by more than half a turn."""
    relaxed = wound(first)
    if relaxed is first:
        return list(starts_from(first, freedoms, count))
    return [*starts_from(first, freedoms, (count + 1) // 2), *starts_from(relaxed, freedoms, count // 2)]


def _settled(tangent: Tangent, freedoms: int, known: list[Newton]) -> Newton | None:
    """Return the equilibrium that is reached from a start; None if there is none."""
    if tangent.freedoms == freedoms:
        return balanced(tangent, freedoms, known)
    here = Newton(tangent)
    return here if here.is_balanced else None


def _is_known(settled: Newton, other: Newton) -> bool:
    """Return whether two equilibria are one, or of one family."""
    if settled.tangent.freedoms != other.tangent.freedoms:
        return bool(np.abs(settled.tangent.to(other.tangent)).max() < np.sqrt(ONE_POSE))
    return are_one(other, settled)


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
    return turning(scene)


def _equilibrium(found: Newton, singular: bool, freedoms: int) -> Equilibrium:
    tangent = found.tangent.along(found.directions)
    model, count = tangent.model, len(tangent.model.scene.body)
    q = tangent.q.reshape(1, model.nb, 7)
    angles = tangent.angles[None]
    turned = {
        name: float(each[0]) for name, each in angles_by_joint(model.scene, model.structure, angles).items()
    }
    scene = placed_with_springs(model, tangent.q, turned)
    placed = tangent.frame.with_armature(scene, tangent.frame.armature)
    placed = placed.with_(body=tangent.frame.bodies(scene))
    if singular or tangent.freedoms != freedoms:
        none = np.zeros(0, dtype=complex)
        return Equilibrium(placed, none, np.zeros((0, count, 6), dtype=complex), {}, tangent.frame.rate)
    refuse_meeting_ends(model, tangent.q, tangent.basis, "small motions are not linear")
    eigenvalues = eigenvalues_of(linear_at(tangent, found.directions.T @ found.away()))
    blocks = model.terms(np.zeros(1), q, angles=angles).blocks
    forces = reactions(model, q, blocks, multipliers(tangent)[None], angles)
    return Equilibrium(
        placed,
        eigenvalues.values,
        _shapes(tangent, eigenvalues.shapes),
        {name: wrench[0] for name, wrench in forces.items()},
        tangent.frame.rate,
        eigenvalues.bounds,
    )


def _shapes(tangent: Tangent, vectors: np.ndarray) -> np.ndarray:
    """Return the motions (2f, nb, 6) of the bodies for eigenvectors y (f, 2f), scaled such that the largest
    entry is one length of the mechanism, or one radian."""
    model, count = tangent.model, len(tangent.model.scene.body)
    moved = (tangent.basis @ vectors).T.astype(complex)
    largest = moved[np.arange(len(moved)), np.abs(moved[:, : 6 * count]).argmax(axis=1)]
    shapes = (model.units * moved / largest[:, None]).reshape(len(moved), model.nb, 6)[:, :count]
    turned = tangent.q.reshape(model.nb, 7)[:count, 3:]
    for part in (shapes.real, shapes.imag):
        part[..., 3:] = rotations.rotate(turned, part[..., 3:])
    return shapes
