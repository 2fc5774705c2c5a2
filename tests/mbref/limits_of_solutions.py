"""Checks of thresholds of solutions and searches: starts, iterations, small numbers, steps of analyses."""

import math
from types import SimpleNamespace

import numpy as np

from mbref import scene_fields, scene_slips
from mbref.design import assemble, equilibrium, linearisation, offsets, turning
from mbref.equations import diagnosis, initial_state
from mbref.equations.model import Model
from mbref.equations.packing import Packs
from mbref.integrators.adams import ADAMS
from mbref.kernels.layout import NOT_CONVERGED, OK
from mbref.linear_algebra import minimum_norm, vectors
from mbref.scene import GROUND, Body, Factor, Revolute, Scene, SceneError, Universal
from mbref.simulation import rounded_numbers
from mbref.stabilisation import partitioning
from mbref.stepping import run as runs
from mbref.stepping.limits import GENERIC
from mbref.stepping.ranks import Ranks
from mbref.taylor.stepper import SeriesStepper
from tests.mbref.limits_of_equations import pendulum
from tests.mbref.threshold_checks import check, first_arguments, flips, near


def calls_of(monkeypatch, module, name, result=None):
    """The list that grows with each call of a function of a module, which then returns a result."""
    made = []
    monkeypatch.setattr(module, name, lambda *given, **_: made.append(given) or result)
    return made


def accepts(make, *given):
    """Whether a call raises neither ValueError nor SceneError."""
    try:
        make(*given)
    except (ValueError, SceneError):
        return False
    return True


# --- scenes ---------------------------------------------------------------------------------------------
@check("scene_fields LARGEST")
def _(_):
    return flips(lambda value: accepts(scene_fields.checked_size, value), 0.98e40, 1.02e40)


@check("scene_fields SMALLEST")
def _(_):
    return flips(lambda value: not accepts(scene_fields.checked_length, value), 0.98e-40, 1.02e-40)


@check("scene_fields COINCIDENT")
def _(monkeypatch):
    """Two points 1 m from the origin; where they count as one, the mechanism has no length."""
    for module in ("mbref.equations.packing", "mbref.scene_slips"):
        monkeypatch.setattr(f"{module}.COINCIDENT", scene_fields.COINCIDENT)

    def is_one(apart):
        body = Body(name="b", mass=1e-9, inertia=(1e9, 1e9, 1e9), position=(1.0, 0.0, 0.0))
        hinge = Revolute(name="A", bodies=(GROUND, "b"), anchor=(1.0 + apart, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        scene = Scene(name="two points", body=(body,), joint=(hinge,))
        found = {Packs([scene]).length[0] == 1.0, not list(scene_slips._inertias(scene))}
        assert len(found) == 1, "the warnings and the equations disagree"
        return found.pop()

    return flips(is_one, 0.95e-14, 1.05e-14)


@check("scene_functions FEWEST_ROWS")
def _(_):
    table = lambda count: Factor(table=[(float(k), 1.0) for k in range(count)])  # noqa: E731
    return accepts(table, 4) and not accepts(table, 3)


@check("scene_joints RIGHT_ANGLE")
def _(_):
    def is_kept(cosine):
        axes = ((1.0, 0.0, 0.0), (cosine, 1.0, 0.0))
        return Universal(name="U", bodies=("a", "b"), anchor=(0.0, 0.0, 0.0), axes=axes).axes == axes

    return flips(is_kept, 0.98e-15, 1.02e-15)


@check("scene_slips FLAT_MECHANISM")
def _(_):
    return flips(scene_slips._is_zero, 0.98e-6, 1.02e-6)


# --- starts ---------------------------------------------------------------------------------------------
@check("equations.initial_state CLOSED")
def _(monkeypatch):
    monkeypatch.setattr(initial_state, "MOST_ITERATIONS", 0)
    scenes = initial_state._alone(Model(pendulum()))

    def closes(gap):
        q = scenes.poses.copy()
        q[0, 0] += gap
        return not initial_state._corrected(scenes, q)[2]

    return flips(closes, 0.98e-10, 1.02e-10)


@check("equations.initial_state MOST_ITERATIONS")
def _(monkeypatch):
    made = calls_of(monkeypatch, initial_state, "_least_changes", np.full((1, 12), 1e-14))
    scenes = initial_state._alone(Model(pendulum()))
    q = scenes.poses.copy()
    q[0, 0] += 0.01
    initial_state._solved(scenes, q, np.full(1, np.inf))
    return len(made) == 30


@check("equations.initial_state START_RANK_TOLERANCE")
def _(monkeypatch):
    scenes = initial_state._alone(Model(pendulum()))
    blocks = scenes.terms(np.zeros(1, dtype=int), scenes.poses, np.zeros((1, 12))).blocks
    call = lambda: initial_state._least_changes(scenes, np.zeros(1, dtype=int), blocks, np.ones((1, 10)))  # noqa: E731
    return near(first_arguments(monkeypatch, initial_state, "least_norm", call)[2], 1e-5)


def sparse_start(monkeypatch):
    """The weights of the equations that a sparse start solves, and the number of its solutions."""
    weights, solutions = [], []

    class Recorded(minimum_norm.MinimumNorm):
        def __init__(self, matrix, weight):
            weights.append(weight)
            super().__init__(matrix, weight)

        def __call__(self, rhs):
            solutions.append(len(weights))
            return super().__call__(rhs)

    monkeypatch.setattr(initial_state, "MinimumNorm", Recorded)
    model = Model(pendulum(rate=1.0))
    scenes = initial_state._alone(model)
    scenes = scenes._replace(mass=np.where(np.arange(12) == 5, 0.0, 2.0)[None])
    terms = model.terms(0.0, model.start())
    given = np.arange(12) == 6
    rates = initial_state.Rates(np.zeros(12), given, terms.nu, np.ones(12), terms.blocks)
    initial_state._sparse_velocities(scenes, 0, rates)
    return weights, solutions


@check("equations.initial_state OPEN_WEIGHT")
def _(monkeypatch):
    weights, _ = sparse_start(monkeypatch)
    return near(weights[1][0], 1e-4) and near(weights[1][6], 1.0)


@check("equations.initial_state REPEATS")
def _(monkeypatch):
    return sparse_start(monkeypatch)[1].count(2) == 5


@check("equations.initial_state LEAST_WEIGHT")
def _(monkeypatch):
    weights, _ = sparse_start(monkeypatch)
    return near(weights[2][5], 2e-6) and near(weights[2][0], 2.0)


@check("equations.diagnosis UNIQUE_TOLERANCE")
def _(_):
    return flips(lambda weight: not diagnosis.take_part(np.array([[weight]]))[0], 0.98e-8, 1.02e-8)


@check("equations.diagnosis UNIQUE_SHARE")
def _(monkeypatch):
    monkeypatch.setattr(diagnosis, "LARGE", 0)
    monkeypatch.setattr(diagnosis, "MOST_DIAGNOSED_ROWS", 0)

    def is_unique(share):
        found = SimpleNamespace(rank=10, shares=np.full(10, share), singular_values=lambda: (1.0, 1.0))
        monkeypatch.setattr(diagnosis, "_redundancy", lambda *_: found)
        return bool(diagnosis.diagnose(pendulum()).unique_reactions)

    return flips(is_unique, 0.98e-9, 1.02e-9)


@check("stepping.run NEARLY")
def _(monkeypatch):
    def is_nearly_dependent(least):
        monkeypatch.setattr(runs, "ranks_at", lambda *_: Ranks(1, least, 0.0))
        settings = SimpleNamespace(rounding=1e-15, independent=0, nearly_dependent=0)
        memory = SimpleNamespace(
            state=SimpleNamespace(coordinates=np.zeros(7), velocities=np.zeros(6)),
            equations=SimpleNamespace(system=SimpleNamespace(settings=settings)),
            pivots=np.ones(1),
            factor=None,
            watch=SimpleNamespace(),
            active=SimpleNamespace(velocities=np.zeros(2)),
        )
        run = SimpleNamespace(
            memory=memory,
            start=SimpleNamespace(q=np.zeros(7), v=np.zeros(6)),
            model=SimpleNamespace(length=1.0),
            limits=SimpleNamespace(rank_tolerance=1e-10),
            method=SimpleNamespace(stabilisation=SimpleNamespace(projects=True)),
            scene=SimpleNamespace(driver=()),
            _blocks=None,
        )
        runs.Run.put_start(run)
        return settings.nearly_dependent

    return flips(is_nearly_dependent, 0.98e-5, 1.02e-5)


@check("simulation.rounded_numbers LEAST_GAP")
def _(monkeypatch):
    eps = np.finfo(float).eps
    run = SimpleNamespace(model=SimpleNamespace(m=1), start=SimpleNamespace(q=np.array([3.0])))

    def is_silent(gap):
        monkeypatch.setattr(rounded_numbers, "gap_of", lambda _: gap)
        return rounded_numbers.advice(run) == ""

    return flips(is_silent, 99.5 * 3.0 * eps, 100.5 * 3.0 * eps)


def redundant_hinges():
    """A run of a bar on two hinges about one axis."""
    body = Body(name="bar", mass=1.0, inertia=(0.1, 0.2, 0.3), position=(1.0, 0.0, 0.0))
    hinges = (
        Revolute(name=name, bodies=(GROUND, "bar"), anchor=(0.0, 0.0, z), axis=(0.0, 0.0, 1.0))
        for name, z in (("A", 0.0), ("B", 1.0))
    )
    model = Model(Scene(name="hinges", body=(body,), joint=tuple(hinges)))
    return SimpleNamespace(model=model, start=SimpleNamespace(q=model.start()))


@check("simulation.rounded_numbers POSE_STEP")
def _(monkeypatch):
    call = lambda: rounded_numbers.gap_of(redundant_hinges())  # noqa: E731
    _, moved = first_arguments(monkeypatch, rounded_numbers, "displaced", call)
    return near(np.abs(moved).max(), 0.1)


@check("simulation.rounded_numbers POSE_ITERATIONS")
def _(monkeypatch):
    run = redundant_hinges()
    made = calls_of(monkeypatch, rounded_numbers, "displaced", run.start.q)
    rounded_numbers.gap_of(run)
    return len(made) == 1 + 12


# --- linear algebra -------------------------------------------------------------------------------------
@check("linear_algebra.vectors TINY")
def _(_):
    def vanishes(value):
        values = np.array([value])
        vectors.flush_denormals(values)
        return values[0] == 0.0

    return flips(vanishes, 0.98e-100, 1.02e-100)


def solution_of(monkeypatch, change):
    """Number of iterations of a system that is solved once, whose changes have a size relative to x."""
    solution = minimum_norm.MinimumNorm.__new__(minimum_norm.MinimumNorm)
    factor = SimpleNamespace(residual=np.zeros(1), change=np.array([change]))
    solution.d, solution._scale, solution._root = np.zeros((1, 1)), np.ones(1), 1.0
    solution._rows, solution._factor = np.zeros(1, dtype=int), SimpleNamespace(values=factor, argument=None)
    made = []

    def iterate(x, _):
        x[:] = 1.0
        made.append(1)

    monkeypatch.setattr(minimum_norm, "iterate_once", iterate)
    solution(np.ones(1))
    return len(made)


@check("linear_algebra.minimum_norm ITERATIONS")
def _(monkeypatch):
    return solution_of(monkeypatch, 1.0) == 20


@check("linear_algebra.minimum_norm LAST_CHANGE")
def _(monkeypatch):
    return flips(lambda change: solution_of(monkeypatch, change) == 1, 0.98e-15, 1.02e-15)


@check("linear_algebra.minimum_norm DEPENDENT_ROW")
def _(monkeypatch):
    """A direction with a singular value below the limit is left to rounding."""
    for name in ("subtract_product", "solve", "go_along"):
        monkeypatch.setattr(minimum_norm, name, lambda *_: None)
    monkeypatch.setattr(minimum_norm, "norm_of", lambda *_: 0.0)

    def is_left(value):
        ones = lambda: np.ones(1)  # noqa: E731
        factor = SimpleNamespace(residual=ones(), step=ones(), change=np.zeros(1), direction=ones())
        put = lambda f, d, x: x.__setitem__(0, value)  # noqa: E731
        monkeypatch.setattr(minimum_norm, "times_transpose", put)
        return minimum_norm.go_on_by_conjugate_directions(factor, 1.0, None, None) == OK

    return flips(is_left, 0.98e-11, 1.02e-11)


# --- partitioning ---------------------------------------------------------------------------------------
@check("stabilisation.partitioning MOST_DEPENDENT_STEPS")
def _(monkeypatch):
    made = calls_of(monkeypatch, partitioning, "find_violation", 1.0)
    for name in ("predict_dependent", "evaluate", "lu_solve"):
        monkeypatch.setattr(partitioning, name, lambda *_: None)
    monkeypatch.setattr(partitioning, "factorise_dependent", lambda _: True)
    scratch = SimpleNamespace(
        column_order=np.zeros(0, dtype=int),
        partition=SimpleNamespace(rank=0),
        residual=np.zeros(0),
        dependent=None,
        exchanges=None,
    )
    monkeypatch.setattr(partitioning, "scratch_of", lambda _: scratch)
    settings = SimpleNamespace(newton_tolerance=1e-13)
    system = SimpleNamespace(settings=settings, counts=SimpleNamespace(newton=0))
    state = SimpleNamespace(coordinates=np.zeros(0), velocities=np.zeros(0))
    run = SimpleNamespace(state=state, chart=None, equations=SimpleNamespace(system=system))
    status = partitioning.solve_dependent_coordinates(0.0, np.zeros(0), run)
    return status == NOT_CONVERGED and len(made) == 20


@check("stabilisation.partitioning SINGULAR_DEPENDENT")
def _(monkeypatch):
    monkeypatch.setattr(partitioning, "jacobian_by_euler_parameters", lambda *_: None)

    def is_singular(pivot):
        scratch = SimpleNamespace(
            jacobian=np.array([[pivot]]),
            dependent=np.zeros((1, 1)),
            partition=SimpleNamespace(rank=1, pivot=0.0),
            row_order=np.zeros(1, dtype=int),
            column_order=np.zeros(1, dtype=int),
            exchanges=np.zeros(1, dtype=int),
        )
        monkeypatch.setattr(partitioning, "scratch_of", lambda _: scratch)
        counts = SimpleNamespace(factorisations=0)
        equations = SimpleNamespace(system=SimpleNamespace(counts=counts))
        run = SimpleNamespace(chart=None, equations=equations, state=SimpleNamespace(coordinates=None))
        return not partitioning.factorise_dependent(run)

    return flips(is_singular, 0.98e-13, 1.02e-13)


# --- integrators ----------------------------------------------------------------------------------------
@check("integrators.adams HIGHEST")
def _(_):
    """The stored differences reach two orders beyond the highest one."""
    from mbref.integrators import adams

    return adams._gamma_star().size == 14 and accepts(ADAMS.highest_order, {"max_order": 12})


def steps_of(order):
    """Whether a driven run takes predictor steps at a wanted order (0: the default), and their order."""
    method = SimpleNamespace(options_of=lambda _: {"order": order}, integrator=None)
    run = SimpleNamespace(
        limits=SimpleNamespace(code=GENERIC, branches=()),
        method=method,
        memory=SimpleNamespace(control=SimpleNamespace(rtol=1e-6, atol=1e-6)),
    )
    found = SeriesStepper._kind_of_steps(SimpleNamespace(run=run, is_driven=True))
    return found[0], found[2]


@check("taylor.driven PREDICTOR_ORDER")
def _(monkeypatch):
    from mbref.taylor import driven

    monkeypatch.setattr("mbref.taylor.stepper.PREDICTOR_ORDER", driven.PREDICTOR_ORDER)
    return steps_of(0) == (True, 16)


@check("taylor.driven LEAST_PREDICTOR_ORDER")
def _(monkeypatch):
    from mbref.taylor import driven

    monkeypatch.setattr("mbref.taylor.stepper.LEAST_PREDICTOR_ORDER", driven.LEAST_PREDICTOR_ORDER)
    return steps_of(12)[0] and not steps_of(11)[0]


@check("stepping.singular_crossing PRODUCT_ALPHA")
def _(monkeypatch):
    from mbref.stepping import singular_crossing

    ends = SimpleNamespace(gradient=None, squared_pivots=np.ones(0), pivots=np.ones(0))
    run = SimpleNamespace(
        loop=SimpleNamespace(ends=ends),
        factor=None,
        watch=SimpleNamespace(reference_pivot=1.0),
        pivots=np.ones(0),
    )
    call = lambda: singular_crossing.passes_singular_position(1.0, run)  # noqa: E731
    return near(first_arguments(monkeypatch, singular_crossing, "factorise_product", call)[2], 1e8)


# --- designs --------------------------------------------------------------------------------------------
@check("design.assemble MOST_LINK_STEPS")
def _(monkeypatch):
    made = calls_of(monkeypatch, np.linalg, "pinv", np.zeros((9, 3)))
    ends, points = [(0, 1), (1, 2), (0, 2)], np.eye(3)
    assert not accepts(assemble._with_distances, "body", points, ends, [1.0, 1.0, 9.0])
    return len(made) == 50


@check("design.equilibrium FORCE_FREE")
def _(monkeypatch):
    scene = SimpleNamespace(duration=2.0)
    monkeypatch.setattr(equilibrium, "find_scene", lambda _: SimpleNamespace(assembled=lambda: scene))
    monkeypatch.setattr(equilibrium, "Model", lambda _: SimpleNamespace(length=3.0))
    monkeypatch.setattr(equilibrium, "consistent_start", lambda _: SimpleNamespace(q=None))
    for name in ("Tangent", "_frame", "_balanced", "unsteady"):
        monkeypatch.setattr(equilibrium, name, lambda *_: None)
    monkeypatch.setattr(equilibrium, "_starts", lambda *_: ["pose"])
    monkeypatch.setattr(equilibrium, "_equilibrium", lambda pose: pose)

    def is_free(scale):
        monkeypatch.setattr(equilibrium, "_scale", lambda _: scale * 3.0 / 4.0)
        return equilibrium.equilibria("scene") == ["pose"]

    return flips(is_free, 0.98e-9, 1.02e-9)


@check("design.linearisation SHORT")
def _(_):
    moved = []
    found = linearisation.Tangent.__new__(linearisation.Tangent)
    found.step, found.basis = 0.5, np.eye(1)
    found.accelerations = lambda y, _: moved.append(y[0]) or np.zeros(1)
    found.slope()
    return near(moved[0], 0.04 * 0.5)


@check("design.turning PARALLEL_TO_GRAVITY")
def _(_):
    def is_steady(sine):
        axis = (0.0, 0.0, 1.0)
        gravity = (9.81 * sine, 0.0, -9.81 * math.sqrt(1.0 - sine**2))
        joint = Revolute(name="A", bodies=(GROUND, "bar"), anchor=(0.0, 0.0, 0.0), axis=axis)
        return accepts(turning.turning, pendulum(rate=1.0).with_(gravity=gravity, joint=(joint,)))

    return flips(is_steady, 0.98e-12, 1.02e-12)


def turned(monkeypatch, phi=0.0, change=0.0):
    """The reason why a turning mechanism is not steady, with such residuals after it has turned, and the
    angles (rad) by which it turned."""
    angles = []
    frame = SimpleNamespace(
        rate=2.0,
        velocities=lambda *_: np.zeros(1),
        turned=lambda model, q, angle: angles.append(angle),
        turned_rates=lambda model, v, angle: v,
    )
    model = SimpleNamespace(
        terms=lambda *_: SimpleNamespace(phi=np.array([phi])), length=1.0, row_joint=["A"]
    )
    tangent = SimpleNamespace(model=model, frame=frame, freedoms=1, step=0.1, pose=lambda _: np.zeros(1))
    found = iter([np.ones(1), np.ones(1) + change])
    monkeypatch.setattr(linearisation, "accelerations", lambda *_: next(found))
    return linearisation.unsteady(tangent), angles


@check("design.turning TURNED_BY")
def _(monkeypatch):
    monkeypatch.setattr(linearisation, "TURNED_BY", turning.TURNED_BY)
    return near(turned(monkeypatch)[1][0], 1.0)


@check("design.turning UNCHANGED")
def _(monkeypatch):
    monkeypatch.setattr(linearisation, "UNCHANGED", turning.UNCHANGED)
    by_rows = flips(lambda phi: not turned(monkeypatch, phi=phi)[0], 0.98e-9, 1.02e-9)
    return by_rows and flips(lambda change: not turned(monkeypatch, change=change)[0], 0.98e-9, 1.02e-9)


# --- offsets of couplings -------------------------------------------------------------------------------
def displaced(monkeypatch, entry, residual=0.0):
    """A function of a displacement: the function by which offsets are solved then moves an entry by it."""

    def solve(size):
        solved = lambda model, t, q, value: (q + size * np.eye(q.size)[entry], np.full(1, residual))  # noqa: E731
        monkeypatch.setattr(offsets, "solve_positions", solved)

    return solve


@check("design.offsets LARGEST_PART")
def _(monkeypatch):
    """In metres of a mechanism's length, and in components of a quaternion, which are half a rotation."""
    scene = pendulum()
    length = Model(scene).length

    def is_small(entry, size):
        displaced(monkeypatch, entry)(size)
        return offsets._is_small(scene, np.zeros(0))

    places = flips(lambda size: is_small(0, size * length), 0.98 * 0.2, 1.02 * 0.2)
    return places and flips(lambda size: is_small(4, size / 2), 0.98 * 0.2, 1.02 * 0.2)


@check("design.offsets MET_OFFSET")
def _(monkeypatch):
    scene = pendulum()
    longest = max(1.0, Model(scene).length)

    def is_met(residual):
        displaced(monkeypatch, 0, residual)(0.0)
        return accepts(offsets.assembled.__wrapped__, scene)

    return flips(is_met, 0.98e-12 * longest, 1.02e-12 * longest)
