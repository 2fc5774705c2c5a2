"""Metrics: a metric is one number of a run, computed from the scene, the trajectory and the exact motion.

Errors are measured at the samples that the run reached and at which the truth is known, so that a failed run
is judged up to its end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.judge import constraints, events
from crosscheck.judge.energy import energy_series
from crosscheck.judge.events import at_samples
from crosscheck.judge.full_turns import counted_poses
from crosscheck.judge.joint_reactions import SAMPLES, compare
from crosscheck.judge.pieces import has_pieces
from crosscheck.judge.reaction_balance import with_exact_reactions
from crosscheck.judge.start import started
from crosscheck.judge.tolerances import LEAST_ORDER, ROUNDING, STRAIGHT_LINE
from crosscheck.judge.truth import NoSolution, Truth
from crosscheck.judge.violations import violation_series
from mbref import rotations
from mbref.motions.trajectory import PER_BODY, Trajectory
from mbref.scene import Scene

MANY = 50  # bodies; the comparison of reactions is left out for more, because it would take too long


STATES = ("times", *PER_BODY)
KEPT = 16  # exact motions whose reactions are kept
_with_reactions: dict[Any, Trajectory] = {}  # keyed by scene and states


@dataclass(frozen=True)
class Metric:
    """A metric; ``function(scene, trajectory, exact)`` returns its value, or None if the metric is not
    defined. ``exact`` is the truth's trajectory at the run's times or the first of these times, or None.
    A trajectory that is not finite has infinite errors. With ``per_piece``, the metric of a scene with
    intervals is the largest one of its pieces, and not defined if it is NaN for a piece.
    """

    function: Callable[[Scene, Trajectory, Trajectory | None], float | None]
    unit: str
    label: str
    per_piece: bool = False


def measure(scene: Scene, trajectory: Trajectory, truth: Truth | None = None) -> dict[str, float | None]:
    """Return every metric of a trajectory.

    Parameters
    ----------
    scene : Scene
        The mechanism.
    trajectory : Trajectory
        The run of any engine.
    truth : Truth, optional
        The exact motion, as ``truth_for`` returns it.

    Returns
    -------
    dict of str to float or None
        Metrics by name (`crosscheck list metrics`); ``error_bound``, the bound on the truth's own error; and
        ``error_until``, the time (s) of the last sample that has an error. Both are None without a truth or
        without a sample.

    Raises
    ------
    ValueError
        If the bodies differ from the bodies of the scene.
    """
    scene, trajectory = started(scene), in_scene_order(scene, trajectory)
    exact = exact_motion(scene, trajectory, truth)
    with np.errstate(all="ignore"):  # metrics report states that are not finite, without warnings
        pieces = list(events.parts(scene, trajectory, exact))
        found = {
            name: _largest_of([metric.function(*piece) for piece in pieces])
            if metric.per_piece
            else metric.function(scene, trajectory, exact)
            for name, metric in METRICS.items()
        }
    if exact is None or not trajectory.times.size:
        return found | {"error_bound": None, "error_until": None}
    assert truth is not None
    bound = exact.settings.get("bound", truth.accuracy)
    return found | {"error_bound": bound, "error_until": float(exact.times[-1])}


def exact_motion(scene: Scene, trajectory: Trajectory, truth: Truth | None) -> Trajectory | None:
    """Return the truth at a trajectory's times, with full turns counted; if the truth ends early, at the
    first of these times. None without a truth, or if the truth is known at the start only.
    """
    if truth is None:
        return None
    try:
        return counted_poses(scene, truth, trajectory.times)
    except NoSolution as end:
        known = trajectory.times[trajectory.times <= end.until]
        return counted_poses(scene, truth, known) if known.max(initial=0.0) > 0 else None


def in_scene_order(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with its bodies in the order of the scene; raises ValueError for other bodies."""
    names = tuple(body.name for body in scene.body)
    if trajectory.bodies == names:
        return trajectory
    if sorted(trajectory.bodies) != sorted(names):
        raise ValueError(f"trajectory of {trajectory.bodies}, scene of {names}")
    order = [trajectory.bodies.index(name) for name in names]
    keys = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
    arrays: dict[str, Any] = {k: None if (a := getattr(trajectory, k)) is None else a[:, order] for k in keys}
    return replace(trajectory, bodies=names, **arrays)


def position_error_series(scene: Scene, trajectory: Trajectory, exact: Trajectory) -> np.ndarray:
    """Return the largest distance (k,) of a body's centre from its true position, divided by the scene's
    length."""
    distance = np.linalg.norm(trajectory.position - exact.position, axis=-1)
    return distance.max(axis=-1) / constraints.scene_length(scene)


def rotation_error_series(scene: Scene, trajectory: Trajectory, exact: Trajectory) -> np.ndarray:
    """Return the largest geodesic angle (k,) between a body's orientation and its true orientation, rad."""
    return rotations.angle_between(trajectory.orientation, exact.orientation).max(axis=-1)


def error_series(scene: Scene, trajectory: Trajectory, exact: Trajectory) -> np.ndarray:
    """Return the larger (k,) of relative position error and rotation error."""
    return np.maximum(
        position_error_series(scene, trajectory, exact), rotation_error_series(scene, trajectory, exact)
    )


def _against_exact(series: Callable[..., np.ndarray]) -> Callable[..., float | None]:
    def largest(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
        return None if exact is None else _largest(series(scene, _known(trajectory, exact), exact))

    return largest


def _violation(level: int) -> Callable[..., float | None]:
    """Return the largest violation at a level; NaN if turns of a coupling cannot be counted."""

    def largest(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
        series = violation_series(scene, trajectory, level)
        if series is None or not np.isnan(series).any():
            return _largest(series)
        used = [getattr(trajectory, key) for key in PER_BODY[: 2 * level + 2]]
        return math.nan if all(np.isfinite(a).all() for a in used) else math.inf

    return largest


def _energy(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
    if has_pieces(scene):
        return events.energy_error(scene, trajectory)
    return _largest(energy_series(scene, trajectory))


def _correct_digits(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
    """Return -log10 of the error; the error counts as at least the rounding unit."""
    error = _error(scene, trajectory, exact)
    return None if error is None or math.isinf(error) else -math.log10(max(error, ROUNDING))


def _velocity_error(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
    """Return the largest error of a velocity, or of an angular velocity times the scene's length, relative to
    the largest true velocity."""
    if exact is None or not len(trajectory.times):
        return None
    trajectory, length = _known(trajectory, exact), constraints.scene_length(scene)
    pairs = [
        (trajectory.velocity, exact.velocity),
        (length * trajectory.angular_velocity, length * exact.angular_velocity),
    ]
    scale = max(np.linalg.norm(true, axis=-1).max() for _, true in pairs)
    worst = [_largest(np.linalg.norm(got - true, axis=-1)) or 0.0 for got, true in pairs]
    return max(worst) / float(scale) if scale > 0 else None


def _largest_of(values: Sequence[float | None]) -> float | None:
    """Return the largest value of pieces; None if no piece has one, or one of them is NaN."""
    known = [value for value in values if value is not None]
    return None if not known or any(map(math.isnan, known)) else max(known)


def _largest(series: np.ndarray | None) -> float | None:
    if series is None or series.size == 0:
        return None
    return float(series.max()) if np.isfinite(series).all() else math.inf


def reaction_error(scene: Scene, trajectory: Trajectory, exact: Trajectory | None) -> float | None:
    """Return the largest difference of the unique part of the reactions from the reactions of the exact
    motion, relative to the largest reaction, at some samples; None without reactions, masses or a truth, and
    for more than MANY bodies."""
    if exact is None or trajectory.reactions is None or not len(trajectory.times):
        return None
    if not scene.joint or not scene.has_mass() or len(scene.body) > MANY:
        return None
    chosen = np.unique(np.linspace(0, len(exact.times) - 1, SAMPLES).round().astype(int))
    true = _exact_reactions(scene, at_samples(exact, chosen))
    if any(np.isnan(wrench).any() for wrench in (true.reactions or {}).values()):
        return None  # full turns on which the forces depend cannot be counted
    found = compare(scene, true, at_samples(trajectory, chosen))
    worst = max([found.resultant, *(joint.unique for joint in found.joints.values())])
    return worst if math.isfinite(worst) else math.inf


def _exact_reactions(scene: Scene, exact: Trajectory) -> Trajectory:
    """Return the exact motion with its reactions; the runs of a comparison are measured against few exact
    motions, which are kept."""
    key = (scene, *(a if (a := getattr(exact, name)) is None else a.tobytes() for name in STATES))
    if key not in _with_reactions:
        if len(_with_reactions) >= KEPT:
            del _with_reactions[next(iter(_with_reactions))]
        _with_reactions[key] = with_exact_reactions(scene, exact)
    return _with_reactions[key]


def _known(trajectory: Trajectory, exact: Trajectory) -> Trajectory:
    """Return the trajectory at the samples of the truth."""
    count = len(exact.times)
    return trajectory if count == len(trajectory.times) else at_samples(trajectory, np.arange(count))


_error = _against_exact(error_series)

METRICS: dict[str, Metric] = {
    "error": Metric(_error, "", "error (position/length or rotation angle)"),
    "position_error": Metric(_against_exact(position_error_series), "", "position error / scene length"),
    "rotation_error": Metric(_against_exact(rotation_error_series), "rad", "rotation error"),
    "scd": Metric(_correct_digits, "digits", "significant correct digits"),
    "velocity_error": Metric(_velocity_error, "", "relative velocity error"),
    "violation_position": Metric(_violation(0), "rad", "violation of position constraints", True),
    "violation_velocity": Metric(_violation(1), "rad/s", "violation of velocity constraints", True),
    "violation_acceleration": Metric(_violation(2), "rad/s²", "violation of acceleration constraints", True),
    "energy_error": Metric(_energy, "", "drift of the energy balance / largest energy"),
    "reaction_error": Metric(reaction_error, "", "error of unique reactions / largest true reaction", True),
    "event_time_error": Metric(events.event_time_error, "s", "distance of events from the judge's own"),
    "impact_error": Metric(events.impact_error, "", "error of velocities after impacts / largest velocity"),
    "impulse_error": Metric(events.impulse_error, "", "momentum balance of impacts / momentum"),
    "impact_energy_error": Metric(
        events.impact_energy_error, "", "energy balance of impacts / energy before"
    ),
}


def order_of_convergence(
    steps: Sequence[float], errors: Sequence[float], least: float = LEAST_ORDER
) -> float | None:
    """Return the slope of log error over log step in the longest range of at least three neighbouring steps
    that is nearly straight and has a slope above ``least``.

    None if no such range exists, for example at the rounding level.
    """
    table = np.array([(s, e) for s, e in zip(steps, errors, strict=True) if 0 < e < math.inf]).reshape(-1, 2)
    x, y = np.log10(table[np.argsort(table[:, 0])]).T
    best: tuple[int, float] | None = None
    for i in range(len(x)):
        for j in range(i + 3, len(x) + 1):
            slope, level = np.polyfit(x[i:j], y[i:j], 1)
            scatter = np.sqrt(np.mean((slope * x[i:j] + level - y[i:j]) ** 2))
            if scatter <= STRAIGHT_LINE and slope > least:
                best = max(best or (0, 0.0), (j - i, float(slope)))
    return None if best is None else best[1]


def cost_at_error(costs: Sequence[float], errors: Sequence[float], level: float) -> float | None:
    """Return the cost of reaching an error by log-log interpolation between the best runs (no other run is
    both cheaper and more accurate).

    The result is the cheapest run's cost if this run reaches the level, None if no run does.
    """
    best: list[tuple[float, float]] = []
    for cost, error in sorted(zip(costs, errors, strict=True)):
        if math.isfinite(error) and cost > 0 and (not best or error < best[-1][1]):
            best.append((cost, max(error, ROUNDING**2)))
    if not best or best[-1][1] > level:
        return None
    reached = next(i for i, (_, error) in enumerate(best) if error <= level)
    if reached == 0:
        return best[0][0]
    (c0, e0), (c1, e1) = best[reached - 1], best[reached]
    share = math.log(e0 / level) / math.log(e0 / e1)
    return float(c0 * (c1 / c0) ** share)
