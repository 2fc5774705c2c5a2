"""Checks of thresholds of the equations, linear algebra, formulations, integrators and the projection."""

import math
from types import SimpleNamespace

import numpy as np

from mbref.equations import (
    active_coordinates,
    branches,
    diagnosis,
    initial_state,
    joint_reactions,
    units,
)
from mbref.equations.model import Model
from mbref.formulations import alf_dual, lm1, lm2
from mbref.integrators import one_step
from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR
from mbref.linear_algebra import minimum_norm
from mbref.scene import GROUND, Body, Driver, Revolute, Scene
from mbref.stabilisation import projection
from mbref.taylor import orientations
from tests.mbref.threshold_checks import check, first_arguments, flips, near


def pendulum(rate=0.0):
    """A double pendulum whose first bar turns at a given rate."""
    body = Body(name="bar", mass=1.0, inertia=(0.1, 0.2, 0.3), position=(1.0, 0.0, 0.0))
    second = Body(name="end", mass=1.0, inertia=(0.1, 0.2, 0.3), position=(2.0, 0.0, 0.0))
    joints = (
        Revolute(name="A", bodies=(GROUND, "bar"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),
        Revolute(name="B", bodies=("bar", "end"), anchor=(1.5, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),
    )
    drivers = (Driver(joint="A", polynomial=(0.0, rate)),) if rate else ()
    return Scene(name="pendulum", body=(body, second), joint=joints, driver=drivers, duration=1.0)


# --- equations ------------------------------------------------------------------------------------------
@check("equations.units SPREAD")
def _(_):
    found = units.metric(np.array([[1.0, 1.0, 1.0, 1e-9, 1e-9, 1e-9]]), np.array([[2.0]]))
    return near(found[0, 3], (0.5 * 2.0) ** 2)


@check("equations.units SHORTEST_LENGTH")
def _(_):
    def takes_mean(length):
        arms = np.array([[2.0, 0.0, 0.0], [length, 0.0, 0.0]])
        return units.body_lengths(arms, np.eye(2))[1] == 2.0

    return flips(takes_mean, 2e-9 * 0.98, 2e-9 * 1.02)


@check("equations.diagnosis RANK_TOLERANCE")
def _(monkeypatch):
    def is_deficient(value):
        monkeypatch.setattr(diagnosis, "scaled_jacobian", lambda *_: np.diag([1.0, value]))
        return diagnosis.rank_at_start(SimpleNamespace(m=2), SimpleNamespace(q=None)) == 1

    return flips(is_deficient, 0.98e-10, 1.02e-10)


@check("equations.diagnosis PERTURBATION")
def _(_):
    model = Model(pendulum(rate=5.0))
    start = initial_state.consistent_start(model)
    fastest = np.abs(start.v.reshape(-1, 6)[:, 3:]).max()
    return near(diagnosis.perturbed_state(model, start)[0], 1e-2 / fastest)


@check("equations.active_coordinates STILL")
def _(_):
    def rests(value):
        q, v = np.zeros((1, 7)), np.array([[1.0, value, 0.0, 0.0, 0.0, 0.0]])
        return active_coordinates.without_rounding(q, v, np.zeros((1, 6)), np.ones(1))[1][0, 1] == 0.0

    return flips(rests, 0.98e-12, 1.02e-12)


@check("equations.initial_state MET")
def _(monkeypatch):
    """Velocities with a residual above the limit are replaced by the most accurate ones."""

    def keeps_first(residual):
        monkeypatch.setattr(
            initial_state, "rate_violation", lambda _, __, w: residual if w[0] == 1.0 else 0.0
        )
        terms = SimpleNamespace(jacobian=np.zeros((1, 2)), nu=np.zeros(1))
        model = SimpleNamespace(terms=lambda *_: terms)
        return initial_state._best_met(model, None, [np.ones(2), np.zeros(2)])[0] == 1.0

    return flips(keeps_first, 0.98e-13, 1.02e-13)


@check("equations.initial_state NEAR_SINGULAR_RANK")
def _(monkeypatch):
    """A row that is nearly a multiple of another is not corrected."""
    monkeypatch.setattr(initial_state, "rate_violation", lambda *_: 0.0)

    def leaves(value):
        terms = SimpleNamespace(
            jacobian=np.array([[1.0, value], [1.0, -value]]), nu=np.array([value, -value])
        )
        model = SimpleNamespace(terms=lambda *_: terms)
        return abs(initial_state._best_met(model, None, [np.zeros(2)])[1]) < 0.5

    return flips(leaves, 0.98e-9, 1.02e-9)


@check("equations.initial_state GROSS")
def _(_):
    """Violation over the length of the mechanism, which is 1 m at least."""
    length = Model(pendulum()).length

    def is_refused(part):
        scenes = initial_state._alone(Model(pendulum()))
        q = scenes.poses.copy()
        q[0, 7] += part * max(1.0, length)
        return bool(initial_state._corrected(scenes, q)[2])

    return flips(lambda part: not is_refused(part), 0.049, 0.051)


@check("equations.joint_reactions OPEN")
def _(_):
    def vanishes(value):
        structure = SimpleNamespace(dense=lambda _: np.array([[[1.0, value], [1.0, -value]]]))
        model = SimpleNamespace(structure=structure, m=2)
        found, _ = joint_reactions.vanishing_combinations(model, None)
        return found.shape[-1] == 1

    return flips(vanishes, 0.98e-6, 1.02e-6)


# --- branches -------------------------------------------------------------------------------------------
def second_order(forms, freedoms=2):
    return branches.SecondOrder(np.eye(freedoms), np.asarray(forms, dtype=float), np.ones(freedoms))


@check("equations.branches ZERO_FORM")
def _(_):
    form = lambda size: np.array([[[0.0, size], [size, 0.0]]])  # noqa: E731
    return flips(lambda size: len(branches._independent(form(size / math.sqrt(2.0)))) == 0, 0.98e-7, 1.02e-7)


@check("equations.branches SAME")
def _(_):
    fits = lambda value: branches._fits(second_order([[[value, 0], [0, -1.0]]]), np.array([1.0, 0]))  # noqa: E731
    return flips(fits, 0.98e-4, 1.02e-4)


# --- linear algebra and formulations --------------------------------------------------------------------
@check("formulations.lm2 DEPENDENT_PIVOT")
def _(_):
    def is_singular(sine):
        dt = np.array([[1.0, math.sqrt(1.0 - sine)], [0.0, math.sqrt(sine)]])
        return not lm2.factor_schur_complement(2, dt, np.zeros((2, 2)), np.zeros(2))

    return flips(is_singular, 0.95e-11, 1.05e-11)


# --- integrators ----------------------------------------------------------------------------------------
STEP = SimpleNamespace(order=8, atol=1e-6, rtol=1e-6, largest_step=1.0)


@check("integrators.one_step SAFETY")
def _(_):
    return near(one_step.next_step(1.0, 1.0, 1.0, 1.0, STEP), 0.8)


@check("integrators.one_step SHRINK")
def _(_):
    return near(one_step.next_step(1.0, 1.0, 1e30, 1.0, STEP), 0.2)


@check("integrators.one_step GROW")
def _(_):
    return near(one_step.next_step(1.0, 1.0, 0.0, 1.0, STEP), 100.0)


@check("integrators.one_step RETRY")
def _(_):
    return near(one_step.next_step(1.0, 1.0, math.nan, 1.0, STEP), 0.25)


@check("integrators.one_step ROUNDED_ERROR")
def _(_):
    def shows_no_trend(share):
        clock = SimpleNamespace(restart=0, share=share, past_ratio=0.1, past_length=1.0)
        run = SimpleNamespace(
            loop=SimpleNamespace(clock=clock),
            equations=SimpleNamespace(system=SimpleNamespace(counts=SimpleNamespace(steps=5))),
            control=STEP,
        )
        return one_step.trend(1.0, 1.0, run) == 1.0

    return flips(shows_no_trend, 0.0199, 0.0201)


# --- projection -----------------------------------------------------------------------------------------
def watched(squares, **numbers):
    record = SimpleNamespace(
        **{"generic_rank": 0, "reference_pivot": 0.0, "smallest_pivot": 0.0, "regular": 1, **numbers}
    )
    pivots = np.zeros(len(squares))
    projection.watch(np.array(squares), pivots, record)
    return record


@check("stabilisation.projection INDEPENDENT")
def _(_):
    limit = 25.0 * 1e-5
    return flips(lambda square: watched([1.0, square]).generic_rank == 1, 0.98 * limit, 1.02 * limit)


@check("stabilisation.projection LEAST_REFERENCE")
def _(_):
    return near(watched([0.03**2]).reference_pivot, 0.05)


def dependence(pivots, rank):
    run = SimpleNamespace(pivots=np.array(pivots), watch=SimpleNamespace(regular=1, generic_rank=rank))
    return projection.depend_on_others(run)


@check("stabilisation.projection DEPENDENT")
def _(_):
    return flips(lambda pivot: dependence([1.0, pivot], 1), 2.95e-3, 3.05e-3)


@check("stabilisation.projection CLEAR")
def _(_):
    return flips(lambda pivot: not dependence([1.0, pivot, 0.0], 2), 0.049, 0.051)


def newton(monkeypatch, violation, before, moved=0.0):
    """Whether a step of Newton's method computes a new factor."""
    made = []
    monkeypatch.setattr(projection, "evaluate", lambda *_: None)
    monkeypatch.setattr(projection, "factorise_constraints", lambda _: made.append(1) or True)
    monkeypatch.setattr(projection, "correct_positions", lambda _: None)
    scratch = SimpleNamespace(correction=np.array([moved]))
    monkeypatch.setattr(projection, "scratch_of", lambda _: scratch)
    settings = SimpleNamespace(newton_tolerance=1e-14, rounding=1e-15)
    run = SimpleNamespace(
        state=SimpleNamespace(coordinates=None, velocities=None),
        chart=None,
        equations=SimpleNamespace(
            rows=SimpleNamespace(phi=np.array([violation])), system=SimpleNamespace(settings=settings)
        ),
    )
    projection.newton_step(0.0, before, run)
    return bool(made)


@check("stabilisation.projection SMALL")
def _(monkeypatch):
    return flips(lambda before: not newton(monkeypatch, 1e-15, before), 0.98e-8, 1.02e-8)


@check("stabilisation.projection GOOD_REDUCTION")
def _(monkeypatch):
    return flips(lambda left: not newton(monkeypatch, left, 1e-9), 0.98e-11, 1.02e-11)


@check("stabilisation.projection BENT")
def _(monkeypatch):
    return flips(lambda square: not newton(monkeypatch, 1e-15, 1e-9, math.sqrt(square)), 0.98e-15, 1.02e-15)


def positions(monkeypatch, violations):
    """Status and number of Newton steps whose violations are these."""
    left = iter(violations)
    counts = SimpleNamespace(newton=0)
    monkeypatch.setattr(projection, "newton_step", lambda *_: next(left))
    system = SimpleNamespace(settings=SimpleNamespace(newton_tolerance=1e-14), counts=counts)
    run = SimpleNamespace(equations=SimpleNamespace(system=system))
    return projection.project_positions(0.0, run), counts.newton


@check("stabilisation.projection MOST_CORRECTIONS")
def _(monkeypatch):
    return positions(monkeypatch, [1.0 / (k + 1) for k in range(40)])[1] == 10


@check("stabilisation.projection STUCK")
def _(monkeypatch):
    return flips(lambda stuck: positions(monkeypatch, [stuck] * 40) == (OK, 2), 1e-14 * 980.0, 1e-14 * 1020.0)


@check("stabilisation.projection MOVED")
def _(monkeypatch):
    def follows(correction):
        made = []
        monkeypatch.setattr(projection, "evaluate", lambda *_: made.append(1))
        monkeypatch.setattr(projection, "factorise_constraints", lambda _: True)
        scratch = SimpleNamespace(correction=np.array([correction]))
        monkeypatch.setattr(projection, "scratch_of", lambda _: scratch)
        system = SimpleNamespace(settings=SimpleNamespace(rounding=1e-15))
        run = SimpleNamespace(
            chart=None,
            equations=SimpleNamespace(system=system),
            state=SimpleNamespace(coordinates=None, velocities=None),
        )
        projection.follow_last_correction(0.0, run)
        return bool(made)

    return flips(lambda correction: not follows(correction), 29e-15, 31e-15)


# --- ALF-dual -------------------------------------------------------------------------------------------
def exact(monkeypatch, pivot, change=0.0):
    """The result of an exact solution with a least squared pivot, and how often it computes what."""
    made = SimpleNamespace(residuals=0, accelerations=0)

    def count(name, value):
        def called(*_):
            setattr(made, name, getattr(made, name) + 1)
            return value

        return called

    empty = SimpleNamespace(row=np.zeros(0, dtype=int))
    factor = SimpleNamespace(symbolic=empty, step=np.zeros(0), change=np.zeros(0))
    replaced = {
        "factor_of": lambda _: factor,
        "start": lambda *_: True,
        "least_squared_pivot": lambda _: pivot,
        "substitute_back": lambda *_: None,
        "add_transpose": lambda *_: None,
        "substitute_forward": lambda *_: change,
        "square_of_forces": lambda _: 1.0,
        "put_residual": count("residuals", None),
        "put_accelerations": count("accelerations", 1.0),
    }
    for name, function in replaced.items():
        monkeypatch.setattr(alf_dual, name, function)
    made.solved = alf_dual.solve_exactly(SimpleNamespace(scratch=None, multipliers=np.zeros(0)))
    return made


@check("formulations.alf_dual INDEPENDENT_ROWS")
def _(monkeypatch):
    return flips(lambda pivot: not exact(monkeypatch, pivot).solved, 0.98e-4, 1.02e-4)


@check("formulations.alf_dual WIDE")
def _(monkeypatch):
    return flips(lambda pivot: exact(monkeypatch, pivot).residuals == 1, 0.079, 0.081)


@check("formulations.alf_dual SETTLED")
def _(monkeypatch):
    once = lambda part: exact(monkeypatch, 0.01, part**2).accelerations == 1  # noqa: E731
    return flips(once, 0.98e-14, 1.02e-14)


def penalties(monkeypatch, first, statuses):
    """The penalties of the iterations that end so; the last status repeats."""
    tried, left = [], list(statuses)

    def iterated(alpha, _):
        tried.append(alpha)
        return left.pop(0) if len(left) > 1 else left[0]

    monkeypatch.setattr(alf_dual, "iterate_with", iterated)
    monkeypatch.setattr(alf_dual, "options_of", lambda _: SimpleNamespace(alpha=first))
    monkeypatch.setattr(alf_dual, "factor_of", lambda _: None)
    settings = SimpleNamespace(nearly_dependent=False, independent=True)
    alf_dual.iterate_until_solved(SimpleNamespace(options=None, scratch=None, settings=settings))
    return tried


@check("formulations.alf_dual STRONGER")
def _(monkeypatch):
    return near(penalties(monkeypatch, 1e10, [NOT_CONVERGED, OK])[1], 1e13)


@check("formulations.alf_dual LARGEST_ALPHA")
def _(monkeypatch):
    return flips(lambda first: len(penalties(monkeypatch, first, [NOT_CONVERGED])) == 2, 0.98e16, 1.02e16)


@check("formulations.alf_dual REDUNDANT_ALPHA")
def _(monkeypatch):
    return near(penalties(monkeypatch, 1e10, [NOT_CONVERGED, SINGULAR])[-1], 1e15)


# --- further equations ----------------------------------------------------------------------------------
@check("equations.initial_state CONTRADICTED")
def _(monkeypatch):
    """Two drivers of one velocity that differ by twice the residual of each row."""

    def refuse(*_):
        raise LookupError

    monkeypatch.setattr(initial_state, "_contradiction", refuse)
    model = SimpleNamespace(n=1)
    scenes = SimpleNamespace(model=model, mass=np.ones((1, 1)))

    def agree(part):
        rates = initial_state.Rates(
            np.zeros(1),
            np.zeros(1, dtype=bool),
            np.array([1.0 - part, 1.0 + part]),
            np.ones(1),
            np.ones((2, 1)),
        )
        try:
            initial_state._velocities(scenes, 0, rates)
        except LookupError:
            return False
        return True

    return flips(agree, 0.98e-3, 1.02e-3)


def number_of_states(monkeypatch, module, call):
    """The number of random states for which a function asks."""
    return first_arguments(monkeypatch, module, "random_states", call)[0]


@check("equations.active_coordinates STATES")
def _(monkeypatch):
    model = Model(pendulum())
    start = initial_state.consistent_start(model)
    find = lambda: active_coordinates.active_entries(model, start.q, start.v)  # noqa: E731
    return number_of_states(monkeypatch, active_coordinates, find) == 2


@check("equations.joint_reactions SHARE")
def _(monkeypatch):
    monkeypatch.setattr(joint_reactions, "_places", lambda *_: (None, None, np.zeros(1, dtype=int), [0]))
    scene = SimpleNamespace(joint=[SimpleNamespace(name="A")])

    def is_open(weight):
        found = np.array([[[weight]]]), np.ones((1, 1))
        monkeypatch.setattr(joint_reactions, "vanishing_combinations", lambda *_: found)
        dimensions = joint_reactions.open_dimensions(SimpleNamespace(scene=scene, structure=None), None)
        return dimensions["A"][0] == 1

    return flips(lambda weight: not is_open(weight), 0.98e-6, 1.02e-6)


@check("linear_algebra.minimum_norm LEAST_ITERATIONS")
def _(monkeypatch):
    made = []
    monkeypatch.setattr(minimum_norm, "change_by_step", lambda *_: made.append(1) or 0.0)
    for name in ("subtract_product", "substitute_forward", "copy"):
        monkeypatch.setattr(minimum_norm, name, lambda *_: None)
    factor = SimpleNamespace(
        symbolic=SimpleNamespace(row=np.zeros(0, dtype=int)), step=np.zeros(0), total=np.zeros(0)
    )
    factor.change = factor.residual = factor.step
    minimum_norm.solve_to_tolerance(factor, 1.0, 20, None, None)
    return len(made) == 2


@check("linear_algebra.minimum_norm ALPHA")
def _(_):
    """A row of zeros leaves 1/α alone in its equation."""
    from scipy.sparse import csr_array

    solution = minimum_norm.MinimumNorm(csr_array(np.array([[1.0], [0.0]])), np.ones(1))
    return near(solution.regularised_solution(np.array([0.0, 1.0]))[1], 1e10)


@check("formulations.lm1 SINGULAR_PIVOT")
def _(monkeypatch):
    def is_singular(square):
        rows = np.array([[1.0, 0.0], [math.sqrt(1.0 - square), math.sqrt(square)]])
        scratch = SimpleNamespace(matrix=np.zeros((4, 4)), d=np.zeros((2, 2)), b=np.zeros(4))
        scratch.pivots = np.zeros(4, dtype=int)
        monkeypatch.setattr(lm1, "scratch_of", lambda _: scratch)
        system = SimpleNamespace(
            scratch=None,
            inverse_root=np.ones(2),
            multipliers=np.zeros(2),
            jacobian=rows,
            mass=np.ones(2),
            force=np.zeros(2),
            rhs=np.zeros(2),
            acceleration=np.zeros(2),
            counts=SimpleNamespace(factorisations=0),
        )
        return lm1.accelerate.function(system) == SINGULAR

    return flips(is_singular, 0.95e-12, 1.05e-12)


# --- natural coordinates --------------------------------------------------------------------------------
@check("taylor.orientations PARALLEL")
def _(_):
    at = lambda sine: orientations._are_parallel(np.array([1.0, 0, 0]), np.array([1.0, sine, 0]))  # noqa: E731
    return flips(at, 0.98e-9, 1.02e-9)


@check("taylor.orientations APART")
def _(_):
    def is_skipped(sine):
        x, other, z = (
            np.array([1.0, 0, 0]),
            np.array([math.sqrt(1 - sine**2), sine, 0]),
            np.array([0, 0, 1.0]),
        )
        return orientations._basis([x, other, z])[1][2] == 1.0

    return flips(is_skipped, 0.199, 0.201)
