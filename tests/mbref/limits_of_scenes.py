"""Checks of thresholds of scenes, of their design, and of the tolerances and sizes that a method chooses."""

import math
from types import SimpleNamespace

import numpy as np

from mbref import method, scene_slips, second_run
from mbref.design import along_motion, equilibrium, exchange, linearisation
from mbref.ensembles import simulate_all
from mbref.equations import branches
from mbref.kernels.layout import OK
from mbref.method import Method
from mbref.scene import GROUND, Body, Driver, Revolute, Scene, SceneError, Universal
from mbref.simulation import comparison, dead_position, outcome, remedies, start_run, trial
from mbref.stepping.limits import Limits
from mbref.stepping.ranks import Ranks
from mbref.taylor import driven, mode, sample_completion, stepper
from tests.mbref.threshold_checks import check, first_arguments, flips, memory, near


def bar(**given):
    """A bar on a hinge, 1 m from its centre of mass."""
    numbers = {"mass": 1.0, "inertia": (0.1, 0.1, 0.1), "position": (1.0, 0.0, 0.0), **given}
    return Body(name="bar", **numbers)


def hinged(rate=0.0, gravity=(0.0, 0.0, 0.0), load=(), **given):
    """A scene of one such bar, driven at a rate (rad/s) for 1 s if there is one."""
    joint = Revolute(name="A", bodies=(GROUND, "bar"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    drivers = (Driver(joint="A", polynomial=(0.0, rate)),) if rate else ()
    return Scene(
        name="bar",
        body=(bar(**given),),
        joint=(joint,),
        driver=drivers,
        gravity=gravity,
        duration=1.0,
        load=load,
    )


def is_valid(make):
    """Whether the data of a scene are accepted."""
    try:
        make()
    except (SceneError, ValueError):
        return False
    return True


# --- scenes ---------------------------------------------------------------------------------------------
@check("scene_bodies UNIT_TOLERANCE")
def _(_):
    turned = lambda off: is_valid(lambda: hinged(orientation=(1.0 + off, 0.0, 0.0, 0.0)))  # noqa: E731
    return flips(turned, 0.98e-6, 1.02e-6)


@check("scene_joints SKEW")
def _(_):
    def is_right(cosine):
        axes = ((1.0, 0.0, 0.0), (cosine, math.sqrt(1.0 - cosine**2), 0.0))
        return is_valid(
            lambda: Universal(name="U", bodies=(GROUND, "bar"), anchor=(0.0, 0.0, 0.0), axes=axes)
        )

    return flips(is_right, 0.049, 0.051)


@check("scene_validation INERTIA_TOLERANCE")
def _(_):
    rod = lambda off: is_valid(lambda: hinged(inertia=(0.5, 0.5, 1.0 + off)))  # noqa: E731
    return flips(rod, 0.97e-9, 1.03e-9)


def is_suspected(scene, *words):
    """Whether a scene has a probable slip whose sentence has these words."""
    return any(all(word in sentence for word in words) for sentence in scene_slips.probable_slips(scene))


@check("scene_slips STRONGEST")
def _(_):
    strong = lambda g: is_suspected(hinged(gravity=(0.0, -g, 0.0)), "gravity")  # noqa: E731
    return flips(lambda g: not strong(g), 98.0, 102.0)


@check("scene_slips FURTHEST")
def _(_):
    return flips(lambda rate: not is_suspected(hinged(rate=rate), "polynomial"), 98.0, 102.0)


@check("scene_slips GYRATION")
def _(_):
    """The mechanism measures 1 m; three moments m r² have the trace 2 m r² 1.5."""
    wide = lambda r: is_suspected(hinged(inertia=(2 / 3 * r**2,) * 3), "inertia")  # noqa: E731
    return flips(lambda r: not wide(r), 29.5, 30.5)


@check("scene_slips OTHER_UNIT")
def _(_):
    def is_mixed(ratio):
        joints = tuple(
            Revolute(name=name, bodies=(GROUND, "bar"), anchor=(x, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
            for name, x in (("A", 0.0), ("B", 1.0), ("C", 1.0 + ratio))
        )
        return is_suspected(hinged().with_(joint=joints), "millimetres")

    return flips(lambda ratio: not is_mixed(ratio), 295.0, 305.0)


@check("scene_slips QUARTER")
def _(_):
    return is_suspected(hinged(rate=90.0), "turns a second") and not is_suspected(
        hinged(rate=91.0), "turns a second"
    )


# --- design ---------------------------------------------------------------------------------------------
def stability(*eigenvalues):
    """The stability of an equilibrium with these eigenvalues."""
    return equilibrium.Equilibrium(hinged(), np.array(eigenvalues), np.zeros((0, 1, 6)), {}).stability


@check("design.equilibrium STILL_EIGENVALUE")
def _(_):
    return flips(lambda part: stability(-1.0 + 0j, -part + 0j) == "indifferent", 0.98e-6, 1.02e-6)


@check("design.equilibrium SAME_EQUILIBRIUM")
def _(_):
    model = SimpleNamespace(length=1.0)
    at = lambda x: SimpleNamespace(q=np.array([x, 0, 0, 1.0, 0, 0, 0]), units=np.ones(6), model=model)  # noqa: E731
    return flips(lambda x: equilibrium._is_same(at(0.0), at(x)), 0.98e-6, 1.02e-6)


def tangent(off):
    """Poses in one coordinate y with the acceleration ``off``, wherever they are."""
    found = SimpleNamespace(freedoms=1, model=SimpleNamespace(length=1.0))
    found.accelerations = lambda *_: np.array([off])

    def slope():
        raise linearisation.OffConstraints

    found.slope = slope
    return found


@check("design.equilibrium BALANCED")
def _(_):
    return flips(lambda off: equilibrium._balanced(tangent(off), 1.0) is not None, 0.98e-11, 1.02e-11)


@check("design.equilibrium LONGEST_STEP")
def _(monkeypatch):
    """A first step that would be long is shortened."""
    start, moves = tangent(1.0), []
    start.slope = lambda: np.array([[1e-6]])
    monkeypatch.setattr(equilibrium, "_moved", lambda _, y: moves.append(abs(y[0])))
    monkeypatch.setattr(equilibrium, "MOST_NEWTON_STEPS", 1)
    equilibrium._balanced(start, 1.0)
    return near(moves[0], 0.3)


@check("design.equilibrium MOST_NEWTON_STEPS")
def _(monkeypatch):
    start, moves = tangent(1.0), []
    start.slope = lambda: np.array([[1.0]])
    closer = SimpleNamespace(**vars(start))

    def moved(*_):
        moves.append(1)
        closer.accelerations = lambda *_: np.array([1.0 / (1 + len(moves))])
        return SimpleNamespace(**vars(closer))

    monkeypatch.setattr(equilibrium, "_moved", moved)
    equilibrium._balanced(start, 1.0)
    return len(moves) == 60


@check("design.linearisation TANGENT_RANK")
def _(_):
    rows = lambda value: np.array([[1.0, 0.0], [math.sqrt(1.0 - value**2), value]])  # noqa: E731
    freedoms = lambda value: linearisation._null_space(rows(value)).shape[1]  # noqa: E731
    return flips(lambda value: freedoms(value) == 1, 1.9e-9, 2.1e-9)


@check("design.linearisation DIFFERENCE_STEP")
def _(_):
    found = linearisation.Tangent.__new__(linearisation.Tangent)
    terms = SimpleNamespace(jacobian=np.zeros((0, 6)))
    model = SimpleNamespace(length=2.0, nb=1, n=6, terms=lambda *_: terms)
    linearisation.Tangent.__init__(found, model, np.zeros(7), None)
    return near(found.step, 0.005 * 2.0)


@check("design.along_motion SAME_POSE")
def _(_):
    def moves(far):
        motion = SimpleNamespace(position=np.array([[[0.0]], [[far]]]), orientation=np.zeros((2, 1, 4)))
        motion.times, motion.crossings = np.array([0.0, 1.0]), ()
        motion.outcome, motion.message = None, ""
        model = SimpleNamespace(length=1.0, m=0, n=6, closed_loops=0)
        return along_motion._summary(model, motion, np.zeros((2, 0))).moves

    return flips(lambda far: not moves(far), 0.98e-9, 1.02e-9)


@check("design.exchange PART")
def _(_):
    return flips(lambda weight: not exchange._keep_rank(np.array([[weight]])), 0.98e-6, 1.02e-6)


# --- branches -------------------------------------------------------------------------------------------
@check("equations.branches RANK")
def _(_):
    """Rows at a small angle count as dependent."""

    def freedoms(value):
        rows = np.zeros((2, 6))
        rows[0, 0], rows[1, 0], rows[1, 1] = 1.0, math.sqrt(1.0 - value**2), value

        def terms(t, *_):
            return SimpleNamespace(jacobian=rows, nu=np.zeros(2), gamma=np.zeros((*np.shape(t), 2)))

        model = SimpleNamespace(nb=1, n=6, terms=terms, data=SimpleNamespace(lengths=np.ones(1)))
        return branches.second_order(model, 0.0, np.zeros(7), np.zeros(6)).kernel.shape[1]

    return flips(lambda value: freedoms(value) == 5, 1.9e-6, 2.1e-6)


@check("equations.branches ROOT_STARTS")
def _(monkeypatch):
    tried = []
    monkeypatch.setattr(branches, "_root_from", lambda _, a: tried.append(1) or (a, 1.0, False))
    branches._roots_of_many(np.zeros((2, 3, 3)))
    return len(tried) == 200


@check("equations.branches ROOT_ITERATIONS")
def _(monkeypatch):
    made = []
    usual = branches._values
    monkeypatch.setattr(branches, "_values", lambda *a: made.append(1) or usual(*a))
    branches._root_from(np.array([np.diag([1.0, -1.0])]), np.array([1.0, 0.3]))
    return len(made) == 40 + 1


@check("equations.branches ZERO_AT_ROOT")
def _(monkeypatch):
    """A place where the forms are too large is no root."""

    def is_root(left):
        monkeypatch.setattr(branches, "_root_from", lambda _, a: (np.array([1.0, 0, 0]), left, True))
        return bool(branches._roots_of_many(np.zeros((2, 3, 3)))[0])

    return flips(is_root, 0.98e-12, 1.02e-12)


@check("equations.branches BROAD")
def _(monkeypatch):
    """Multiple roots that are near each other count as one."""

    def are_one(angle):
        ends = iter([0.0, angle] * 100)

        def found(*_):
            angle = next(ends)
            return np.array([math.cos(angle), math.sin(angle), 0.0]), 0.0, False

        monkeypatch.setattr(branches, "_root_from", found)
        monkeypatch.setattr(branches, "ROOT_STARTS", 2)
        kept = []
        usual = branches._angle
        monkeypatch.setattr(branches, "_angle", lambda a, b: kept.append(usual(a, b)) or usual(a, b))
        branches._roots_of_many(np.zeros((2, 3, 3)))
        monkeypatch.setattr(branches, "_angle", usual)
        return kept[-1] < branches.BROAD

    return flips(are_one, 0.049, 0.051)


# --- methods and their tolerances -----------------------------------------------------------------------
@check("method MOST_BODIES")
def _(_):
    def is_series(count):
        scene = SimpleNamespace(body=[None] * count)
        return method.default_method(scene) == method.SERIES_METHOD

    return is_series(100) and not is_series(101)


def second(rtol, name="taylor", bodies=1):
    """Method and tolerance of the second run of a motion."""
    by, limits = second_run._finer(
        SimpleNamespace(body=[None] * bodies), Method.parse(name), Limits(rtol=rtol)
    )
    return str(by), limits.rtol


@check("second_run ORDER")
def _(_):
    return "order=24" in second(1e-6)[0]


@check("second_run RTOL_SERIES")
def _(_):
    return near(second(1e-6)[1], 1e-13)


@check("second_run RTOL_EXPLICIT")
def _(_):
    return near(second(1e-6, "alf-dual+projection", 101)[1], 1e-12)


@check("second_run TIGHTER")
def _(_):
    return near(second(1e-13)[1], 1e-14)


def limits_of(monkeypatch, module, call):
    """The limits of the run that a function makes."""
    return first_arguments(monkeypatch, module, "start_run", call)[3]


@check("simulation.comparison TOLERANCE")
def _(monkeypatch):
    run = SimpleNamespace(scene=hinged(), times=None, limits=SimpleNamespace(compared=True))
    run.memory = SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(sample=1)))
    monkeypatch.setattr(comparison, "may_leave", lambda _: True)
    return near(
        limits_of(monkeypatch, comparison, lambda: comparison.compare_with_default(run, 0)).rtol, 1e-10
    )


@check("simulation.trial MOST_TRIAL_STEPS")
def _(monkeypatch):
    monkeypatch.setattr(trial, "KERNELS_OF_SERIES", ())
    run = SimpleNamespace(scene=hinged(), times=None, method=SimpleNamespace(is_series=False))
    return limits_of(monkeypatch, trial, lambda: trial._made(run)).most_steps == 2000


def tried_changes(monkeypatch, rtol):
    """The changes of the limits that are tried where rounding decides the branch at t = 0."""
    tried = []
    monkeypatch.setattr(remedies, "passes_with", lambda _, **changes: tried.append(changes) or False)
    clock = SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(time=0.0)))
    remedies._of_branch(SimpleNamespace(crossings=(), limits=Limits(rtol=rtol), memory=clock))
    return tried


@check("simulation.remedies FINE")
def _(monkeypatch):
    """The tolerance is tried only where it is smaller than the run's."""
    tried = tried_changes(monkeypatch, 1.02e-13)[0].get("rtol", math.inf)
    return near(tried, 1e-13) and len(tried_changes(monkeypatch, 0.98e-13)) == 1


@check("simulation.remedies OTHER")
def _(monkeypatch):
    return tried_changes(monkeypatch, 1e-9)[1] == {"branches": {1: 2}}


@check("simulation.dead_position ROUNDED")
def _(monkeypatch):
    monkeypatch.setattr(outcome, "ROUNDED", dead_position.ROUNDED)
    return flips(lambda value: outcome._rounded(Ranks(1, 1.0, value)) == "", 0.98e-13, 1.02e-13)


@check("ensembles.simulate_all FEW")
def _(monkeypatch):
    """With so many scenes left by a batch, they are run one by one."""

    monkeypatch.setattr(simulate_all, "may_lead", lambda _: True)

    def left_over(completed):
        batch = SimpleNamespace(places=list(range(completed)))
        monkeypatch.setattr(simulate_all, "run_batch", lambda *_: batch)
        runs = SimpleNamespace(ended=SimpleNamespace(batches=[]), _scenes=[None] * 100, alone=lambda _: None)
        return bool(LED(runs, None, list(range(100))))

    return left_over(50) and not left_over(49)


LED = next(
    vars(each)["_led"]
    for each in vars(simulate_all).values()
    if isinstance(each, type) and "_led" in vars(each)
)


# --- taylor ---------------------------------------------------------------------------------------------
def options(scene="four_bar_gravity", rtol=1e-6):
    """Options of a run by Taylor series."""
    from mbref.scenes import find_scene

    run = start_run.start_run(find_scene(scene), Method.parse("taylor"), np.array([1.0]), Limits(rtol=rtol))
    return run.stepper._options


@check("taylor.stepper LAST_TERMS")
def _(_):
    return near(options().regular_tolerance, 0.05 * 2e-6)


@check("taylor.stepper EXACT")
def _(_):
    return near(options().accurate_tolerance, 0.05 * 2e-13)


@check("taylor.stepper EXACT_ORDER")
def _(_):
    return options().accurate_order == 22


@check("taylor.stepper STEPS_WORTH_CODE")
def _(monkeypatch):
    def pays(steps):
        made = []
        run = SimpleNamespace(_wants_code=True, _steps_ahead=lambda: steps, _put_code=lambda: made.append(1))
        stepper.SeriesStepper._generate_where_it_pays(run)
        return bool(made)

    return pays(20_000) and not pays(19_999)


@check("taylor.driven PREDICTOR_TOLERANCE")
def _(monkeypatch):
    most = 30.0 * 22**2 * 3e-7
    monkeypatch.setattr(driven, "expand_at", lambda *_: OK)

    def continues(off):
        state = memory(kind=mode.PREDICTOR, pivot=1.0)
        state.series.terms[2, 0] = off / 2.0
        state.kernels = SimpleNamespace(detect=lambda *_: 0)
        return driven.attempt_predictor_step(1.0, False, state) == OK

    return flips(continues, 0.98 * most, 1.02 * most)


@check("taylor.driven ACCURATE_TOLERANCE")
def _(monkeypatch):
    asked = []
    monkeypatch.setattr(driven, "longest_step", lambda tolerance, _: asked.append(tolerance) or 1.0)
    state = memory()
    state.mode.order, state.options.accurate_order = 11, 22
    driven.length_before(1.0, state)
    return near(asked[0], math.sqrt(1e-13))


@check("taylor.mode NEWTON_TOLERANCE")
def _(_):
    state = memory()
    state.options.regular_order = 16
    mode.set_predictor(state)
    return near(state.mode.tolerance, 1e-4)


@check("taylor.sample_completion SAMPLE_CORRECTIONS")
def _(_):
    """A sample of a predictor step is corrected so often."""
    made = []
    state = memory()
    state.options.follows_drivers = True
    state.kernels = SimpleNamespace(expand=lambda *_: made.append(1) or 0)
    sample_completion.expand_at_sample(state)
    return len(made) == 2
