"""Support matrix: engines' refusals and their notes, and a probe, a small scene, of every feature."""

import numpy as np
import pytest

from crosscheck.cli import support
from crosscheck.conformance.mechanisms.features import (
    JOINTS,
    LOADS,
    PIVOT,
    PLACES,
    feature_scenes,
    massless_link,
)
from crosscheck.engine import BUILT_IN, Cannot, Owner, Setting, engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.constraints import initial_poses, jacobian
from crosscheck.judge.gauss_principle import gauss, stacked
from crosscheck.judge.reference.taylor import natural_motion
from mbref.motions.trajectory import Outcome
from mbref.scene import Joint, Load, Scene, Universal
from mbref.scene.driver_faults import DRIVABLE
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, ROUNDING


def test_probes_have_every_type_of_joint_load_and_driver():
    """The scene format's classes declare the types. One row of the table is of wheels."""

    def kinds(union) -> set[str]:
        return {kind.model_fields["type"].default for kind in union.__args__[0].__args__}

    assert set(JOINTS) == kinds(Joint) - {"rolling", "rolling_line"}, set(JOINTS) ^ kinds(Joint)
    assert set(LOADS) == kinds(Load), set(LOADS) ^ kinds(Load)
    scenes = feature_scenes()
    assert {f"{kind} driver" for kind in DRIVABLE} <= set(scenes), list(scenes)
    wheel, ball = (support.of_features(BUILT_IN).answers[row] for row in ("wheel", "driven orientation"))
    assert all((found["mbref"] is None) and found["mujoco"] for found in (wheel, ball))


@pytest.mark.parametrize(("name", "is_redundant"), [("loop", False), ("redundant loop", True)])
def test_probe_of_a_loop_has_redundant_rows_if_its_name_says_so(name, is_redundant):
    """The judge's constraint matrix decides; its rank counts singular values above 1e-9 of the largest."""
    scene = feature_scenes()[name]
    rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
    assert (np.linalg.matrix_rank(rows, rtol=1e-9) < len(rows)) == is_redundant


STARTS = {"mujoco": 5.2e-11, "pinocchio": ROUNDING, "exudyn": 1.7e-8}  # measured errors of accelerations


@pytest.mark.parametrize("name", STARTS)
def test_every_feature_that_an_engine_does_not_refuse_starts_by_gauss_s_principle(name):
    """A run of each such probe completes a hundredth of the probe's time. Accelerations at the start differ
    from the principle's by at most ten times STARTS, 1e-14 to 1.7e-8 of the largest and at least 1 m/s².
    Exudyn reports none with drivers, and the principle needs masses: at least 20 probes remain."""
    simulator, judged = engine(name), []
    for feature, scene in feature_scenes().items():
        if simulator.cannot(scene) is None:
            times = np.array([0.0, scene.duration / 100])
            run = simulator.run(scene, times, simulator.best_settings(scene)[-1])
            assert run.outcome is Outcome.COMPLETED, f"{feature}: {run.outcome} {run.message}"
            if run.acceleration is not None and scene.has_mass():
                exact = gauss(scene)
                error = np.abs(stacked(scene, run, 0) - exact).max() / max(1.0, np.abs(exact).max())
                assert error < MARGIN * STARTS[name], f"{feature}: {error:.1e}"
                judged.append(feature)
    assert len(judged) >= 20, judged


@pytest.mark.parametrize("name", ["mujoco", "pinocchio", "exudyn", "dart"])
def test_engines_that_map_massless_links_move_them_as_a_universal_joint(name):
    """Two hinges on a link without mass are a universal joint. The engine's best setting moves the body, by
    up to 0.1 m, as the judge's reference with such a joint, to ten times the measured 2e-13 m."""
    pytest.importorskip({"dart": "dartpy"}.get(name, name))
    scene, simulator = massless_link(), engine(name)
    joint = Universal(name="U", bodies=("ground", "body"), anchor=PIVOT, axes=PLACES["axes"])
    whole = scene.with_(body=scene.body[1:], joint=[joint])
    assert simulator.cannot(scene) is None
    times = np.linspace(0.0, scene.duration, 5)
    run = simulator.run(scene, times, simulator.best_settings(scene)[-1])
    exact = natural_motion(whole, times, EXTENDED, seconds=20.0).position
    assert run.outcome is Outcome.COMPLETED, run.message
    assert np.abs(run["body"].position - doubles(exact)[:, 0]).max() < MARGIN * 2e-13, run.message


def test_unsupported_feature_gets_a_numbered_note_with_its_cause():
    """Engines "b" and "c" lack every joint: "– 1" in their columns. Note 1 names both, and the joint."""

    def ask(name: str, scene: Scene) -> Cannot | None:
        lacks = name != "a" and scene.joint
        return Cannot(Owner.ENGINE, f"no {scene.joint[0].type}") if lacks else None

    found = support.of_features(["a", "b", "c"], ask)
    notes = found.notes()
    assert found.row("free body", notes) == ["✓"] * 3, found.row("free body", notes)
    assert found.row("fixed joint", notes) == ["✓", "– 1", "– 1"], found.row("fixed joint", notes)
    assert notes[0] == "b, c: no fixed (missing in the engine)", notes
    assert len(notes) == len(set(notes)), notes


def test_every_built_in_engine_refuses_motion_without_masses():
    """The probe's bodies have no masses, and no driver prescribes their motion."""
    answers = support.of_features(BUILT_IN).answers["motion without masses"]
    assert [name for name, answer in answers.items() if isinstance(answer, Cannot)] == list(BUILT_IN)


CRANKS = {  # engine: its setting, the duration (s), and the largest measured difference of positions (m)
    "pinocchio": (Setting("tuned", {"rtol": 1e-10, "min_step": 1e-4}), 0.1, ROUNDING),
    "simbody": (Setting("merson", {"accuracy": 1e-9}), 0.05, ROUNDING),
    "sundials": (Setting("ggl", {"rtol": 1e-7}), 0.02, 8.8e-9),
}


@pytest.mark.parametrize("name", CRANKS)
def test_driven_crank_moves_alike_with_and_without_masses(name):
    """The driver determines the motion of the slider-crank. Positions differ by at most ten times the
    measured difference in CRANKS, 1e-14 or 8.8e-9 m. Without masses there are no reactions."""
    pytest.importorskip({"simbody": "opensim", "sundials": "sksundae.ida"}.get(name, name))
    setting, duration, measured = CRANKS[name]
    scene = SCENES["spatial_slider_crank_driven"]()
    bare = scene.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body))
    heavy, light = (engine(name).run(s, np.linspace(0.0, duration, 6), setting) for s in (scene, bare))
    assert heavy.outcome is light.outcome is Outcome.COMPLETED
    assert abs(heavy.position - light.position).max() < MARGIN * measured and light.reactions is None
