"""Runs of a scene and of many scenes / arguments, order of calls and sums worked out by hand."""

from __future__ import annotations

import contextlib
import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.ensembles import batch, candidates, simulate_all
from mbref.ensembles.batch import Batch, BatchResult
from mbref.ensembles.candidates import Candidates, Evaluations, Parameters, parameters_of
from mbref.equations.initial_state import LARGE, Start
from mbref.input_error import InputError
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.method import Method, MethodError
from mbref.motion_files import read_json, write_csv, write_json
from mbref.scene import Body, Scene
from mbref.simulation import simulate as simulation
from mbref.stepping.limits import GENERATED, Limits
from mbref.stepping.loop import DONE, PAUSED
from mbref.stepping.run import NEARLY
from mbref.taylor.stepper import SeriesStepper
from mbref.trajectory import Outcome

LONE = Scene(
    name="lone",
    duration=4.0,
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0)),),
)
TAYLOR, EXPLICIT = Method.parse("taylor"), Method.parse("lm1+none/dop853")


# --- one scene ----------------------------------------------------------------------------------------------
@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Runs that are asked for: their scene, method, times and limits."""
    calls: list[Any] = []
    run = SimpleNamespace(release=lambda: calls.append("release"))
    monkeypatch.setattr(simulation, "checked_run", lambda *given: calls.append(given) or run)
    monkeypatch.setattr(simulation, "finish_run", lambda *given: calls.append(given[1]) or "motion")
    return calls


def test_a_run_with_its_defaults(asked):
    assert simulation.simulate(LONE) == "motion"
    (scene, method, times, limits), progress, release = asked
    assert scene is LONE and str(method) == str(TAYLOR) and limits == Limits() and progress is None
    assert times.tolist() == np.linspace(0.0, 4.0, 101).tolist() and release == "release"


def test_a_run_with_other_numbers(asked):
    """A duration replaces the scene's, and a tolerance that of the limits."""
    simulation.simulate(LONE, "lm1+none/rk4", None, Limits(most_steps=7), "progress", duration=2.0, rtol=1e-5)  # type: ignore[arg-type]
    (scene, method, times, limits), progress, _ = asked
    assert scene == LONE.with_(duration=2.0) and str(method) == "lm1+none/rk4" and times[-1] == 2.0
    assert limits == Limits(most_steps=7, rtol=1e-5) and progress == "progress"
    asked.clear()
    simulation.simulate(LONE, EXPLICIT, [0.5, 1.0])
    assert asked[0][1] is EXPLICIT and asked[0][2].tolist() == [0.5, 1.0] and asked[0][0] is LONE
    with pytest.raises(InputError, match="give sample times or a duration, not both"):
        simulation.simulate(LONE, times=[1.0], duration=2.0)


@pytest.mark.parametrize(
    ("times", "says"),
    [
        ("abc", "times: must be numbers"),
        ([[0.0, 1.0]], "times: needs at least one sample time"),
        ([], "times: needs at least one sample time"),
        ([0.0, np.inf], "times: must be finite, not negative and increasing"),
        ([-1e-9, 1.0], "times: must be finite, not negative and increasing"),
        ([0.0, 1.0, 1.0], "times: must be finite, not negative and increasing"),
        ([0.0, 2.0, 1.0], "times: must be finite, not negative and increasing"),
    ],
)
def test_sample_times_that_are_refused(times, says):
    with pytest.raises(InputError) as refused:
        simulation.checked_times(times)
    assert str(refused.value) == says


def test_sample_times_that_are_accepted():
    assert simulation.checked_times((0, 1, 3)).tolist() == [0.0, 1.0, 3.0]
    assert simulation.checked_times([2.5]).dtype == float and simulation.checked_times([0.0]).tolist() == [
        0.0
    ]


@pytest.mark.parametrize(
    ("method", "limits", "says"),
    [
        (
            EXPLICIT,
            {"branches": {1: 2}},
            "branches: lm1[+]none/dop853 does not cross singular positions; use taylor",
        ),
        (EXPLICIT, {"code": GENERATED}, "code: lm1[+]none/dop853 has no generated code; use taylor"),
        (TAYLOR, {"branches": {1: 2}}, ""),
        (TAYLOR, {"code": GENERATED}, "code: no generated code for 'lone' by .*taylor: too long"),
    ],
)
def test_limits_that_a_method_does_not_support(monkeypatch, method, limits, says):
    def start(scene: Scene, *given: Any) -> str:
        if given[-1].code == GENERATED:
            raise NoGeneratedCode("too long")
        return "run"

    monkeypatch.setattr(simulation, "start_run", start)
    if says:
        with pytest.raises(MethodError, match=says):
            simulation.checked_run(LONE, method, np.zeros(1), Limits(**limits))
    else:
        assert simulation.checked_run(LONE, method, np.zeros(1), Limits(**limits)) == "run"


@pytest.mark.parametrize("status", [DONE, PAUSED])
def test_the_end_of_a_run(monkeypatch, status):
    """The branches of a complete run are checked; the time of building has two parts."""
    calls: list[Any] = []
    stepper = SimpleNamespace(advance=lambda progress: calls.append(progress) or (5, 1.5))
    run: Any = SimpleNamespace(stepper=stepper, built=0.25, making=0.5)
    monkeypatch.setattr(simulation, "compare_with_default", lambda run, ended: calls.append(ended) or status)
    monkeypatch.setattr(simulation, "_check_branches", lambda run: calls.append("branches"))
    monkeypatch.setattr(simulation, "trajectory_of", lambda *given: given)
    assert simulation.finish_run(run, "progress") == (run, status, 1.5, 0.75)  # type: ignore[arg-type]
    assert calls == ["progress", 5, *["branches"] * (status == DONE)]


@pytest.mark.parametrize(
    ("branches", "passed", "says"),
    [
        ({}, 0, ""),
        ({2: 1}, 2, ""),
        ({1: 2, 3: 1}, 2, "the motion passes 2 singular positions up to t = 4 s, and no number 3"),
        ({2: 1}, 1, "the motion passes 1 singular position up to t = 4 s, and no number 2"),
        ({1: 1}, 0, "the motion passes 0 singular positions up to t = 4 s, and no number 1"),
    ],
)
def test_branches_of_crossings_that_are_not_passed(branches, passed, says):
    run: Any = SimpleNamespace(
        limits=SimpleNamespace(branches=branches), crossings=[0] * passed, times=[0.0, 4.0]
    )
    with pytest.raises(InputError, match=says) if says else contextlib.nullcontext():
        simulation._check_branches(run)


def test_kernels_are_prepared_in_two_processes(monkeypatch):
    calls: list[Any] = []

    @contextlib.contextmanager
    def beside(kernels: Any, module: str, name: str) -> Any:
        calls.append((kernels is simulation.KERNELS_OF_SERIES, module, name))
        yield
        calls.append("end")

    monkeypatch.setattr(simulation, "compiled_in_background", beside)
    monkeypatch.setattr(simulation.preparation, "prepare", calls.append)
    monkeypatch.setattr(simulation, "prepare_series", lambda: calls.append("series"))
    simulation.prepare(EXPLICIT)
    assert calls == [
        (True, "mbref.taylor.preparation", "prepare_series_backwards"),
        EXPLICIT,
        "series",
        "end",
    ]


@pytest.mark.parametrize(
    ("method", "own", "series", "compiled"),
    [
        (TAYLOR, 1, 1, True),
        (TAYLOR, 1, 0, False),
        (TAYLOR, 0, 1, False),
        (EXPLICIT, 1, 0, True),
        (EXPLICIT, 0, 1, False),
    ],
)
def test_kernels_that_are_compiled(monkeypatch, method, own, series, compiled):
    monkeypatch.setattr(simulation, "KERNELS_OF_SERIES", [SimpleNamespace(is_kept=bool(series))])
    kept = [SimpleNamespace(is_kept=True), SimpleNamespace(is_kept=bool(own))]
    monkeypatch.setattr(simulation.preparation, "kernels_of", lambda method: kept)
    assert simulation.are_compiled(method) is compiled


def test_why_there_is_no_code(monkeypatch):
    calls: list[Any] = []

    def start(scene: Scene, method: Any, times: np.ndarray, limits: Limits) -> None:
        calls.append((scene, method, times.tolist(), limits.code))
        if len(calls) > 2:
            raise NoGeneratedCode("too long")

    monkeypatch.setattr(simulation, "prepare", calls.append)
    monkeypatch.setattr(simulation, "start_run", start)
    assert simulation.why_no_code(LONE, TAYLOR) == "" and simulation.why_no_code(LONE, TAYLOR) == "too long"
    assert calls == [TAYLOR, (LONE, TAYLOR, [4.0], GENERATED)] * 2


# --- numbers of many scenes ---------------------------------------------------------------------------------
def test_arrays_in_which_scenes_differ(monkeypatch):
    """Masses differ, and one of two arrays of the scene."""
    same, other = np.array([1.0, 2.0]), np.array([3.0])
    monkeypatch.setattr(candidates, "arrays_in", lambda part: part)
    system = SimpleNamespace(mass=np.array([1.0]), inverse_root=np.array([1.0]))
    equations: Any = SimpleNamespace(scene=[same, other], system=system)
    data: Any = [np.array([[1.0, 2.0]] * 2), np.array([[3.0], [4.0]])]
    packs: Any = SimpleNamespace(mass=np.array([[1.0], [4.0]]), inverse_root=np.array([[1.0], [1.0]]))
    found = parameters_of(equations, data, packs)
    assert [(a is b, of.tolist()) for (a, of), b in zip(found, (other, system.mass), strict=True)] == [
        (True, [[3.0], [4.0]]),
        (True, [[1.0], [4.0]]),
    ]


def test_numbers_of_candidates(monkeypatch):
    """Coordinates, velocities, the allowed violation, and rounding of mechanisms below one metre."""
    monkeypatch.setattr(
        candidates, "parameters_of", lambda equations, data, packs: [(equations, data, packs)]
    )
    monkeypatch.setattr(candidates, "largest_violation", lambda limits, length: (limits, length))
    packs: Any = SimpleNamespace(length=np.array([0.5, 2.0]), data="data")
    method = SimpleNamespace(
        settings=lambda tolerance: SimpleNamespace(rounding=8.0 if tolerance == 0.0 else 9.0)
    )
    run: Any = SimpleNamespace(method=method, limits="limits", reduced=lambda data, axis: (data, axis))
    settings = SimpleNamespace(name="settings")
    equations = SimpleNamespace(system=SimpleNamespace(settings=settings))
    state = SimpleNamespace(coordinates="q of memory", velocities="v of memory")
    memory: Any = SimpleNamespace(equations=equations, state=state, control="control")
    made = Candidates(packs, "q", "v", {}, [], [])  # type: ignore[arg-type]
    first, places, rates, violation, rounding = made.parameters(run, memory)
    assert first == (equations, ("data", 1), packs)
    assert places == ("q of memory", "q") and rates == ("v of memory", "v")
    assert violation == ("control", ("limits", packs.length), "violation")
    assert rounding[0] is settings and rounding[1].tolist() == [4.0, 8.0] and rounding[2] == "rounding"


def test_terms_of_scenes_at_several_states(monkeypatch):
    """Two scenes at three states: the model has its own numbers afterwards."""
    calls: list[Any] = []

    def along(times: Any, q: Any, v: Any, blocks: Any, rows: Any, forces: Any, argument: str) -> None:
        calls.append((times.tolist(), q.tolist(), v.tolist(), argument))
        blocks[:] = np.arange(12.0) + 100 * len(calls)
        rows[:] = np.arange(6.0) + 10 * len(calls)
        forces[:] = len(calls)

    monkeypatch.setattr(candidates, "evaluate_along", along)
    monkeypatch.setattr(candidates, "parameters_of", lambda *given: [])
    monkeypatch.setattr(Parameters, "write", lambda self, place: calls.append(place))
    memory = SimpleNamespace(values="values", packed=SimpleNamespace(argument="argument"))
    model: Any = SimpleNamespace(
        m=2,
        n=4,
        memory=memory,
        data="data",
        structure="structure",
        entry_columns=np.zeros((2, 6)),
        put_numbers=lambda *given: calls.append(given),
    )
    packs: Any = SimpleNamespace(mass=np.array([[1.0], [2.0], [3.0]]), data=None)
    times, q, v = np.zeros((2, 3)), np.ones((2, 3, 1)), np.full((2, 3, 1), 2.0)
    found = Evaluations(model, packs).terms(np.array([2, 0]), times, q, v)
    assert [call for call in calls if not isinstance(call, tuple)] == [2, 0] and calls[-1] == (
        "values",
        "data",
    )
    assert calls[1] == ([0.0] * 3, [[1.0]] * 3, [[2.0]] * 3, "argument")
    assert found.mass.tolist() == [[3.0], [1.0]] and found.structure == "structure"
    assert found.blocks.shape == (2, 3, 2, 6) and found.blocks[1, 2].ravel().tolist() == list(range(400, 412))
    assert found.phi[0, 0].tolist() == [20.0, 21.0] and found.nu[0, 1].tolist() == [22.0, 23.0]
    assert found.gamma[1, 2].tolist() == [44.0, 45.0] and found.force[1].tolist() == [[4.0] * 4] * 3


# --- batches ------------------------------------------------------------------------------------------------
def lead(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> Any:
    stepper = SeriesStepper.__new__(SeriesStepper)
    stepper._calls = changes.pop("calls", 1)
    monkeypatch.setattr(batch, "begins_at_rest", lambda run: changes.get("rests", False))
    monkeypatch.setattr(batch, "begins_in_motion", lambda run: changes.get("moves", False))
    return SimpleNamespace(
        reduction=changes.get("reduction", "reduction"),
        model=SimpleNamespace(m=changes.get("m", LARGE)),
        ranks=SimpleNamespace(least=changes.get("least", NEARLY)),
        memory=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(sample=changes.get("sample", 3)))),
        times=np.zeros(3),
        stepper=stepper,
    )


@pytest.mark.parametrize(
    ("changes", "may"),
    [
        ({}, True),
        ({"reduction": None}, False),
        ({"m": LARGE + 1}, False),
        ({"least": 0.99 * NEARLY}, False),
        ({"sample": 2}, False),
        ({"calls": 2}, False),
        ({"rests": True}, False),
        ({"moves": True}, False),
    ],
)
def test_runs_that_may_lead_a_batch(monkeypatch, changes, may):
    assert batch.may_lead(lead(monkeypatch, **changes)) is may


@pytest.fixture
def led(monkeypatch: pytest.MonkeyPatch) -> tuple[Batch, list[Any]]:
    """A batch of four scenes, of which scenes 1 to 3 fit; scene 2 fails, and scene 3 crosses twice."""
    calls: list[Any] = []
    samples = SimpleNamespace(q=np.zeros((2, 7)), v=np.zeros((2, 6)), a=np.zeros((2, 6)), m=np.zeros((2, 5)))
    counts = [0] * 6
    memory = SimpleNamespace(
        loop=SimpleNamespace(samples=[samples.q, samples.v, samples.a, samples.m]),
        equations=SimpleNamespace(system=SimpleNamespace(counts=counts)),
    )
    run = SimpleNamespace(
        memory=memory,
        begin_again=lambda: calls.append("run"),
        crossings=["old"],
        times=np.array([0.0, 1.0]),
        model=SimpleNamespace(nb=1),
        scene=SimpleNamespace(body=["b"]),
    )

    def advance(place: list[int]) -> tuple[int, float]:
        k = calls[-1]
        samples.q[:], samples.v[:], samples.a[:], samples.m[:] = k, 10 * k, 100 * k, 1000 * k
        counts[0] = k
        assert run.crossings == []
        run.crossings = ["one", "two"] if k == 3 else []
        return (PAUSED if k == 2 else DONE), 0.5 * k

    stepper = SimpleNamespace(
        begin_again=lambda: calls.append("stepper"),
        parameters=lambda *given: calls.append(given) or ([("a", "b")], [1, 2, 3]),
        taylor="taylor",
        advance_once=lambda: advance(calls),
    )
    monkeypatch.setattr(batch, "_stepper", lambda run: stepper)
    monkeypatch.setattr(batch, "SavedNumbers", lambda part: ("saved", part))

    class Written:
        def __init__(self, values: Any, saved: Any) -> None:
            calls.append((values, saved))

        def write(self, place: int) -> None:
            calls.append(place)

    monkeypatch.setattr(batch, "Parameters", Written)
    monkeypatch.setattr(batch, "lazy_crossings", lambda scene, crossings: (scene, *crossings))
    monkeypatch.setattr(batch, "report_of", lambda start, ranks, count: f"{start} {ranks} {count}")
    monkeypatch.setattr(batch, "facts_of", lambda run: {"engine": "mbref"})
    monkeypatch.setattr(batch, "motion_of", lambda *given: {"given": given})
    packs = SimpleNamespace(
        scenes=["s0", "s1", "s2", "s3"], turns_frames=True, principal=np.arange(4.0).reshape(4, 1)
    )
    found: Any = SimpleNamespace(
        packs=packs,
        q=np.zeros((4, 7)),
        fit=[1, 2, 3, 0],
        starts={k: f"start {k}" for k in range(4)},
        ranks=[f"ranks {k}" for k in range(4)],
        parameters=lambda run, memory: [("c", "d")],
    )
    return Batch(run, found), calls  # type: ignore[arg-type]


def test_a_batch_begins_in_the_memory_of_its_lead(led):
    _, calls = led
    run, stepper, given, (values, saved) = calls
    assert (run, stepper) == ("run", "stepper") and given[2] == [1, 2, 3, 0]
    assert values == [("c", "d"), ("a", "b")] and saved == ("saved", "taylor")


def test_runs_of_a_batch_that_complete(led):
    made, calls = led
    assert made.run() == [1, 3] and calls[4:] == [1, 2, 3]
    found = made.result([1, 3], 10.0)
    assert found.places == [1, 3] and found.seconds == [0.5, 1.5] and found.built == 4.0
    assert found.coordinates.shape == (2, 2, 1, 7) and found.coordinates[1, 0, 0].tolist() == [3.0] * 7
    q, v, a, principal, bodies = found.poses["given"]
    assert v[0, 1, 0].tolist() == [10.0] * 6 and a[1, 1, 0].tolist() == [300.0] * 6 and q is found.coordinates
    assert principal.tolist() == [[[1.0]], [[3.0]]] and bodies == 1
    assert found.multipliers[1].tolist() == [[3000.0] * 5] * 2 and found.counts[:, 0].tolist() == [1, 3]
    assert found.crossings == [(), ("s3", "one", "two")]
    assert found.messages == ["start 1 ranks 1 0", "start 3 ranks 3 3"]
    assert found.facts == {"engine": "mbref"} and found.times.tolist() == [0.0, 1.0]
    made._candidates.packs.turns_frames = False
    assert made.result([1], 2.0).poses["given"][3] is None and made.result([], 2.0).built == 2.0


def test_motions_of_a_batch(monkeypatch):
    """The end is the last time; counts, messages and crossings are those of each run."""
    monkeypatch.setattr(batch, "Motion", lambda **given: given)
    monkeypatch.setattr(batch, "lazy_reactions", lambda *given: {"reactions": given})
    made = BatchResult(
        places=[1, 0],
        times=np.array([0.0, 2.0]),
        poses={"position": np.array([5.0, 6.0])},
        coordinates=np.array([7.0, 8.0]),
        multipliers=np.array([9.0, 10.0]),
        counts=np.arange(12).reshape(2, 6),
        seconds=[0.5, 0.25],
        built=3.0,
        messages=["a", "b"],
        crossings=[(), ("x",)],
        facts={"engine": "mbref", "scene": "other"},
    )
    scenes: Any = [SimpleNamespace(name="s0"), SimpleNamespace(name="s1")]
    (first, one), (second, other) = made.motions(scenes)
    assert (first, second) == (1, 0) and one["scene"] == "s1" and other["mechanism"] is scenes[0]
    assert (one["position"], other["position"], one["t_end"]) == (5.0, 6.0, 2.0)
    assert (one["message"], other["crossings"], one["engine"]) == ("a", ("x",), "mbref")
    assert one["outcome"] is Outcome.COMPLETED and other["reactions"][0] is scenes[0]
    assert other["reactions"][2:] == (8.0, 10.0) and one["times"] is made.times
    cost = other["cost"]
    assert (cost.seconds, cost.build_seconds, cost.steps, cost.newton) == (0.25, 3.0, 6, 10)


def test_a_batch_is_run_with_its_time(monkeypatch):
    calls: list[Any] = []
    monkeypatch.setattr(batch.time, "process_time", iter([10.0, 17.0]).__next__)
    monkeypatch.setattr(batch, "candidates_of", lambda run, scenes: (run, scenes))
    made = SimpleNamespace(run=lambda: [3], result=lambda *given: given)
    monkeypatch.setattr(batch, "Batch", lambda *given: calls.append(given) or made)
    assert batch.run_batch("run", ["scene"]) == ([3], 7.0)  # type: ignore[arg-type, list-item]
    assert calls == [("run", ("run", ["scene"]))]


@pytest.mark.parametrize(
    ("method", "limits", "may"),
    [
        (TAYLOR, Limits(), True),
        (EXPLICIT, Limits(), False),
        (TAYLOR, Limits(branches={1: 2}), False),
        (TAYLOR, Limits(rank_tolerance=1e-10), True),
        (TAYLOR, Limits(rank_tolerance=1.1e-10), False),
    ],
)
def test_methods_that_may_lead_batches(method, limits, may):
    assert simulate_all._can_lead(method, limits) is may


def test_scenes_are_grouped_by_their_structure(monkeypatch):
    """Groups in the order of their first scene; scenes of a method that cannot lead run alone."""
    monkeypatch.setattr(simulate_all, "shape_of", len)
    scenes: Any = ["aa", "b", "cc", "d", "eee"]
    assert simulate_all._by_shape(scenes) == [[0, 2], [1, 3], [4]]
    calls: list[Any] = []

    class Runs:
        def __init__(self, *given: Any) -> None:
            calls.append(given)
            self.ended = simulate_all.Ended()

        def in_batches(self, places: list[int]) -> None:
            calls.append(("batches", places))

        def alone(self, places: list[int]) -> None:
            calls.append(("alone", places))

    monkeypatch.setattr(simulate_all, "_Runs", Runs)
    monkeypatch.setattr(simulate_all.time, "perf_counter", iter([10.0, 17.0, 20.0, 20.5]).__next__)
    assert simulate_all.run_all(scenes, "taylor", np.zeros(1), Limits()).seconds == 7.0
    assert calls[0][1] == TAYLOR and calls[1:] == [("batches", places) for places in ([0, 2], [1, 3], [4])]
    calls.clear()
    assert simulate_all.run_all(scenes, EXPLICIT, np.zeros(1), Limits()).seconds == 0.5
    assert calls[1:] == [("alone", places) for places in ([0, 2], [1, 3], [4])]


def test_ends_of_many_runs():
    """Single runs first, then those of batches by the indices of all scenes; the first error counts."""
    made: Any = SimpleNamespace(motions=lambda scenes: iter([(1, ("m", scenes[1])), (0, ("m", scenes[0]))]))
    ended = simulate_all.Ended(alone={4: "alone"}, batches=[([2, 0], made)])  # type: ignore[dict-item]
    assert list(ended.motions(["s0", "s1", "s2"])) == [(4, "alone"), (0, ("m", "s0")), (2, ("m", "s2"))]  # type: ignore[list-item]
    assert ended.error is None
    first, second = ValueError("first"), ValueError("second")
    ended.errors = {5: second, 3: first}
    assert ended.error is first


# --- files of motions ---------------------------------------------------------------------------------------
def test_a_motion_is_saved_as_json_alone(tmp_path):
    with pytest.raises(
        InputError, match=r"m\.csv: a motion is saved as \.json; for a picture use animate or plot"
    ):
        write_json(tmp_path / "m.csv", LONE, {})
    write_json(tmp_path / "m.JSON", LONE, {"x": float("nan")})
    text = (tmp_path / "m.JSON").read_text()
    assert json.loads(text) == {"scene": LONE.to_dict(), "record": {"x": None}} and text.endswith("}\n")
    for content in ("[]", "{}", "no json", '{"scene": {"name": "s"}, "record": {}}'):
        (tmp_path / "n.json").write_text(content)
        with pytest.raises(InputError, match=r"n\.json: is not a file that Motion\.save wrote"):
            read_json(tmp_path / "n.json")


def test_columns_are_written_with_all_digits(tmp_path):
    write_csv(tmp_path / "m.csv", {"time": np.array([0.0, 0.1]), "x": np.array([1 / 3, 2.0])})
    assert (tmp_path / "m.csv").read_text().splitlines() == ["time,x", f"0.0,{1 / 3!r}", "0.1,2.0"]


def test_starts_of_scenes_without_rounding(monkeypatch):
    """Scene 1 has no consistent start and keeps its pose, at rest; starts lose the rounding of zeros."""
    starts = [Start(np.full(7, k + 1.0), np.full(6, k + 2.0), 0.0, 0.0, f"given {k}") for k in (0, 2)]  # type: ignore[arg-type]
    found = [starts[0], ValueError("none"), starts[1]]
    evaluations: Any = SimpleNamespace(starts=lambda: found)
    packs: Any = SimpleNamespace(
        start=lambda: np.zeros((3, 7)), mass=np.ones((3, 6)), length=np.array([1.0, 2.0, 3.0])
    )
    asked: list[Any] = []

    def rounded(at: Any, rates: Any, given: Any, length: Any) -> Any:
        asked.append((at[:, 0].tolist(), rates[:, 0].tolist(), given.tolist(), length.tolist()))
        return at + 0.5, rates + 0.25

    monkeypatch.setattr(candidates, "without_rounding", rounded)
    of, q, v = candidates._starts("run", packs, evaluations)  # type: ignore[arg-type]
    assert asked == [([1.0, 3.0], [2.0, 4.0], ["given 0", "given 2"], [1.0, 3.0])]
    assert q[:, 0].tolist() == [1.5, 0.0, 3.5] and v[:, 0].tolist() == [2.25, 0.0, 4.25]
    assert list(of) == [0, 2] and of[2].q[0] == 3.5 and of[0].v[0] == 2.25
