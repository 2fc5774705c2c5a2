"""Specialised code against the kernels it is recorded from."""

import ctypes

import numpy as np
import pytest

from crosscheck.conformance.random_mechanisms import random_mechanism
from mbref.equations.coordinates import coordinate_rates
from mbref.equations.evaluation import assemble_system
from mbref.kernels.layout import OK
from mbref.kernels.machine_code import code_at
from mbref.linear_algebra.vectors import larger, largest
from mbref.method import Method, MethodError
from mbref.scene import Body, Fixed, Force, Revolute, Scene, Spring, TorsionSpring
from mbref.scenes import SCENES, find_scene
from mbref.simulation.outcome import trajectory_of
from mbref.simulation.run import Run
from mbref.simulation.simulate import Limits, simulate
from mbref.specialised import assembly
from mbref.specialised.assembly import Piece, text_of
from mbref.specialised.build import RecordingState
from mbref.specialised.tracing import Record, Scalar, Untraceable, inputs, plain

PAPER = ("spatial_slider_crank", "planar_slider_crank", "four_bar", "five_bar")
CALL = ctypes.CFUNCTYPE(ctypes.c_longlong, ctypes.c_double, *[ctypes.c_void_p] * 5)


def runs(scene, method, end=0.02, **limits):
    """The same run by the general kernels and by specialised code."""
    times = np.linspace(0.0, end, 5)
    return [
        simulate(scene, method, times, Limits(code=code, **limits)) for code in ("generic", "specialised")
    ]


def apart(one, other):
    """The largest difference of poses and, relative, accelerations.

    Reactions of redundant rows, which 1/alpha alone determines, hold to alpha times rounding only.
    """
    assert one.outcome == other.outcome, f"{one.message} / {other.message}"
    assert len(one.times) == len(other.times)
    size = np.abs(one.acceleration).max() + np.abs(one.angular_acceleration).max()
    force = 1.0 + max(np.abs(reaction).max() for reaction in one.reactions.values())
    for joint, reaction in one.reactions.items():
        difference = np.abs(reaction - other.reactions[joint]).max() / force
        assert difference < 1e-4, f"reaction of {joint}: {difference:.1e}"
    return max(
        np.abs(one.position - other.position).max(),
        np.abs(one.orientation - other.orientation).max(),
        np.abs(one.acceleration - other.acceleration).max() / (1.0 + size),
    )


@pytest.mark.parametrize("formulation", ("lm2", "alf", "alf-dual"))
@pytest.mark.parametrize("name", PAPER)
def test_rates_of_the_code_are_those_of_the_kernels(name, formulation):
    method = Method.parse(f"{formulation}+projection")
    try:
        run = Run(SCENES[name](), method, np.array([1.0]), Limits(code="specialised"))
    except Untraceable:
        assert not method.formulation.handles_redundancy, name
        return
    with_redundancy = method if method.formulation.handles_redundancy else Method.parse("alf-dual+projection")
    generic = Run(SCENES[name](), with_redundancy, np.array([1.0]), Limits(code="generic"))
    kernel = generic.method.stabilisation.fallback_rates.callable  # of all rows, as the code
    rng = np.random.default_rng(7)
    code, size = CALL(run.specialised.addresses.rates), int(run.memory.loop.clock.y_size)
    compared = 0
    for scale in (0.0, 1e-4, 1e-3, 1e-3, 1e-2):
        y = run.memory.loop.y[:size] + scale * rng.normal(size=size)
        ours, angles, multipliers = np.zeros(size), np.zeros(1), np.zeros(run.model.m)
        data = [x.ctypes.data for x in (y, angles, run.memory.code.numbers, ours, multipliers)]
        held = code(scale, *data) == OK
        theirs = np.zeros(size)
        assert kernel(scale, y, theirs, generic.packed.argument) == OK
        if not held:  # the number of iterations of ALF depends on the state
            assert formulation == "alf" and scale > 0.0, "a guard failed beside the start"
            continue
        compared += 1
        nq = run.part.active.coordinates.size
        for part in (slice(0, nq), slice(nq, size)):
            apart = np.abs(ours - theirs)[part].max() / (1.0 + np.abs(theirs[part]).max())
            assert apart < 1e-10, f"{name}: {apart:.1e} apart at {scale}"
    assert compared == 5 or formulation == "alf", f"{name}: {compared} states compared"
    assert compared > 0


@pytest.mark.parametrize("name", (*PAPER, "planar_slider_crank_equal", "four_bar_gravity"))
def test_runs_agree_with_the_kernels_to_rounding(name):
    end = 0.2 if name.endswith(("equal", "gravity")) else 0.02
    first = 5e-4  # s; of a shorter one the error estimate, from which the next follows, is rounding
    generic, own = runs(SCENES[name](), "alf-dual+projection", end, rtol=1e-10, first_step=first)
    assert apart(generic, own) < 1e-9, f"{name}: {apart(generic, own):.1e}"
    if name == "planar_slider_crank":
        assert (generic.cost.steps, generic.cost.rejected) == (own.cost.steps, own.cost.rejected)


@pytest.mark.parametrize("seed", (3, 16, 17, 35))
def test_random_mechanisms_agree_with_the_kernels(seed):
    generic, own = runs(random_mechanism(seed), "alf-dual+projection", 0.05, rtol=1e-9)
    assert apart(generic, own) < 1e-7, f"seed {seed}: {apart(generic, own):.1e}"


def test_loads_agree_with_the_kernels():
    hinge = Revolute(name="H", bodies=("ground", "b"), anchor=(0, 0, 0), axis=(0, 1, 1))
    scene = Scene(
        name="loads", gravity=(0, 0, -9.81), joint=(hinge,),
        body=(Body(name="b", position=(1.0, 0.2, 0.0), mass=2.0, inertia=(0.1, 0.7, 0.7)),),
        load=(
            Spring(
                bodies=("ground", "b"), points=((0, 0, 1), (1, 0, 0)), stiffness=8, damping=0.1,
                natural_length=1.0,
            ),
            TorsionSpring(joint="H", stiffness=3.0, damping=0.2, natural_angle=4.0),
            Force(body="b", point=(1, 0, 0), force=(0, 1, 2)),
        ),
    )  # fmt: skip
    generic, own = runs(scene, "alf-dual+projection", 3.0, rtol=1e-10)
    assert apart(generic, own) < 1e-9, apart(generic, own)


def entries(scene):
    """Coordinates and velocities that are integrated."""
    run = Run(scene, Method.parse("alf-dual+projection"), np.array([0.1]), Limits())
    return run.part.active.coordinates.size, run.part.active.velocities.size


@pytest.mark.parametrize(
    "scene", [*(SCENES[name]() for name in PAPER), random_mechanism(3)], ids=lambda s: s.name
)
def test_a_trace_shows_that_what_is_left_out_stays_at_rest(scene):
    """With the rest constant, no row of what moves bears on it: zeros of the record.

    Nor a force or γ, but on what rows of its own hold.
    """
    run = Run(scene, Method.parse("alf-dual+projection"), np.array([0.1]), Limits())
    recording = RecordingState(run.model, run.method, 1e-10, run.start, run.part)
    state, equations = recording.memory.state, recording.memory.equations
    plain(assemble_system)(recording.t, state.coordinates, state.velocities, equations)
    active, system = run.part.active, equations.system
    bears = np.zeros((run.model.m, run.model.n + 6), dtype=bool)
    np.put_along_axis(bears, run.model.entry_columns, np.vectorize(is_something)(system.blocks), axis=1)
    rows = run.part.factor.symbolic.row.astype(int)
    still = np.setdiff1d(np.arange(run.model.n), active.velocities)
    others = np.setdiff1d(np.arange(run.model.m), rows)
    assert bears.any(axis=1)[rows].all()
    by_rows, held = run.part.factor.static.row.astype(int), run.part.factor.static.column.astype(int)
    plain(coordinate_rates)(state.coordinates, state.velocities, state.coordinate_rates)
    assert not bears[np.ix_(rows, np.setdiff1d(still, held))].any()
    assert not bears[np.ix_(others, active.velocities)].any()
    assert not any(map(is_something, system.rhs[np.setdiff1d(others, by_rows)]))
    assert not any(map(is_something, system.force[np.setdiff1d(still, held)]))
    assert not any(map(is_something, np.delete(state.coordinate_rates, active.coordinates)))


def is_something(value):
    """Whether a number of a record can be other than zero."""
    return isinstance(value, Scalar) or value != 0


def test_planar_mechanisms_keep_the_entries_of_their_plane():
    assert entries(SCENES["planar_slider_crank"]()) == (9, 7)
    assert entries(SCENES["five_bar"]()) == (16, 12)
    assert entries(SCENES["spatial_slider_crank"]()) == (12, 10), "its crank and its slider move in one way"
    pushed = SCENES["planar_slider_crank"]()
    pushed = pushed.with_(load=(*pushed.load, Force(body="rod", point=(0.2, 0, 0), force=(0, 0, 1e-9))))
    assert entries(pushed) == (16, 14), "redundant rows share a force across the plane, however small"


def test_auto_takes_the_code_where_many_steps_are_ahead_and_agrees():
    times, scene, method = (
        np.array([0.3]),
        SCENES["planar_slider_crank"](),
        "alf-dual+projection/rk4[step=1e-5]",
    )
    generic = simulate(scene, method, times, Limits(code="generic"))
    run = Run(scene, Method.parse(method), times, Limits())
    auto = trajectory_of(run, *run.advance(None), 0.0)
    assert run.specialised is not None, f"{auto.cost.steps} steps by general kernels"
    assert apart(generic, auto) < 1e-9
    short = Run(scene, Method.parse(method), np.array([0.2]), Limits())
    short.advance(None)
    assert short.specialised is None, "a short run does not make code"


def test_code_is_kept_and_another_scene_has_its_own():
    scene = SCENES["four_bar"]()
    first = Run(scene, Method.parse("alf-dual+projection"), np.array([0.1]), Limits(code="specialised"))
    again = Run(scene, Method.parse("alf-dual+projection"), np.array([0.1]), Limits(code="specialised"))
    assert again.specialised.code is first.specialised.code, "one process loads it once"
    body = (scene.body[0].model_copy(update={"mass": 0.75}), *scene.body[1:])
    heavier = Run(scene.with_(body=body), first.method, np.array([0.1]), Limits(code="specialised"))
    assert heavier.specialised.code is not first.specialised.code


@pytest.mark.parametrize(
    ("method", "reason"),
    [
        ("mpi-svd+projection", "chooses pivots"),
        ("alf-dual+baumgarte", "baumgarte has no specialised code"),
        ("lm2+partitioning", "partitioning has no specialised code"),
    ],
)
def test_what_cannot_be_laid_down_beforehand_is_said(method, reason):
    with pytest.raises(MethodError, match=reason):
        simulate(SCENES["four_bar"](), method, (0.01,), Limits(code="specialised"))


def test_a_long_chain_has_no_code_of_its_own_and_says_so_at_once():
    with pytest.raises(MethodError, match="122 rows are active, more than 60"):
        simulate(find_scene("four_bar_chain[20]"), "alf-dual+projection", (0.01,), Limits(code="specialised"))


@pytest.mark.parametrize("code", ("generic", "specialised"))
def test_a_body_without_joints(code):
    body = Body(name="b", position=(0, 0, 0), mass=2, inertia=(1, 2, 3))
    scene = Scene(name="thrown", gravity=(0, -9.81, 0), body=(body,))
    fall = simulate(scene, "alf-dual+projection", (0.5,), Limits(code=code))
    assert fall.outcome.name == "COMPLETED", fall.message
    assert abs(fall.position[-1, 0, 1] + 0.5 * 9.81 * 0.25) < 1e-12


@pytest.mark.parametrize("method", ("alf-dual+projection", "lm2+projection/adams", "kinematic"))
def test_a_body_that_cannot_move(method):
    body = Body(name="b", position=(1, 0, 0), mass=2, inertia=(1, 2, 3))
    weld = Fixed(name="W", bodies=("ground", "b"), anchor=(0, 0, 0))
    scene = Scene(name="welded", gravity=(0, -9.81, 0), joint=(weld,), body=(body,))
    rest = simulate(scene, method, (0.0, 1.0))
    assert rest.outcome.name == "COMPLETED", rest.message
    assert np.abs(rest.position[-1] - [[1, 0, 0]]).max() < 1e-13
    assert abs(np.abs(rest.reactions["W"][-1, 1]) - 2 * 9.81) < 1e-9


def test_too_long_a_record_is_refused(monkeypatch):
    monkeypatch.setattr(assembly, "MOST_OPERATIONS", 100)
    scene = SCENES["four_bar"]()
    scene = scene.with_(body=(scene.body[0].model_copy(update={"mass": 0.8125}), *scene.body[1:]))
    with pytest.raises(MethodError, match="operations, more than 100"):
        simulate(scene, "alf-dual+projection", (0.01,), Limits(code="specialised"))


def traced(folder, function, *samples):
    """(call, piece) of a function of scalars by machine code."""
    record = Record()
    value = plain(function)(*inputs(record, "y", np.array(samples)))
    piece = Piece("f", record, [value])
    code = code_at(folder / "f.code", lambda: text_of([piece]))

    def call(*arguments):
        y, out = np.array(arguments, dtype=float), np.zeros(1)
        status = CALL(code.address("f"))(0.0, *(x.ctypes.data for x in (y, y, y, out, out)))
        return status, out[0]

    return call, piece


def test_a_guard_tells_when_a_branch_goes_the_other_way(tmp_path):
    def branch(x, y):
        return x - y if x > y else 2.0 * y

    call, _ = traced(tmp_path, branch, 3.0, 1.0)
    assert call(5.0, 2.0) == (0, 3.0)
    assert call(2.0, 5.0)[0] == 1


def test_constants_fold_and_equal_operations_are_recorded_once(tmp_path):
    def expression(x, y):
        return 0.0 * x + 1.0 * y + (x - x) + (x * y) * (x * y)

    call, piece = traced(tmp_path, expression, 3.0, 1.0)
    assert [piece.record.operations[k][0] for k in piece.live()] == ["y 0", "y 1", "fmul", "fmul", "fadd"]
    assert call(2.0, 5.0) == (0, 105.0)


def test_the_larger_size_needs_no_guard(tmp_path):
    call, piece = traced(tmp_path, lambda x, y: largest(np.array([x, y], dtype=object)), 3.0, -4.0)
    assert piece.record.guards == {}
    assert [call(*pair)[1] for pair in ((1.0, -2.0), (-3.0, 2.0))] == [2.0, 3.0]
    assert larger(1.0, -2.0) == 2.0


def test_a_driver_that_starts_smoothly_does_not_spoil_the_code():
    """At rest without forces the start itself needs no iteration; what moves later does."""
    scene = SCENES["four_bar"]()
    smooth = scene.driver[0].model_copy(update={"polynomial": (0.0, 0.0, 0.0, 1e4)})
    body = tuple(b.model_copy(update={"velocity": None, "angular_velocity": None}) for b in scene.body)
    generic, own = runs(scene.with_(driver=(smooth,), body=body), "alf-dual+projection", 0.05)
    assert own.cost.rhs <= 1.1 * generic.cost.rhs, "steps went over to the general kernels"
    assert apart(generic, own) < 1e-9
