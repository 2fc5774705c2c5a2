"""Code or XML that crosscheck shows for a run makes the settings that the engine's adapter makes."""

import re
from typing import Any

import numpy as np
import pytest

import mbref
from crosscheck.engine import Setting, engine
from crosscheck.study.grades import Judged
from mbref import find_scene

SCENE = find_scene("planar_slider_crank")
HARDENED = {"step": 2e-4, "beta": 300.0, "hard": 1e-7}
MODEL = (
    "<mujoco>{}<worldbody><body name='a'><freejoint/><geom size='1' mass='2'/></body></worldbody>"
    "<equality><connect body1='a' anchor='0 0 0'/></equality></mujoco>"
)


@pytest.mark.parametrize(
    ("family", "options"),
    [
        ("defaults", {"step": 5e-4}),
        *((family, {"step": 3e-4}) for family in ("stock", "euler", "implicit", "implicitfast")),
        ("tuned", HARDENED),
        ("stiff", {**HARDENED, "beta": 1000.0}),
    ],
)
def test_shown_mjcf_and_python_set_the_options_of_a_mujoco_run(family, options):
    """A model with the shown XML and Python has the options and softness of the adapter's model. Its inverse
    weights, which regularise the closures, are MuJoCo's times the option ``hard``, to rounding."""
    mujoco = pytest.importorskip("mujoco")
    from crosscheck.engines.mujoco.simulation import Simulation

    xml, _, python = engine("mujoco").own_code(SCENE, Setting(family, options)).partition(" and in Python: ")
    model = mujoco.MjModel.from_xml_string(MODEL.format(xml))
    before = model.body_invweight0.copy(), model.dof_invweight0.copy()
    exec(python, {"model": model})
    own = Simulation(SCENE, Setting(family, options)).model
    for name in ("timestep", "integrator", "jacobian", "iterations", "tolerance", "disableflags", "solver"):
        assert getattr(model.opt, name) == getattr(own.opt, name), name
    for name in ("eq_solref", "eq_solimp"):
        assert np.allclose(getattr(model, name)[0], getattr(own, name)[0]), name
    factor = options.get("hard", 1.0)
    assert np.allclose(model.body_invweight0, factor * before[0], rtol=1e-14, atol=0)
    assert np.allclose(model.dof_invweight0, factor * before[1], rtol=1e-14, atol=0)


def test_family_defaults_of_mujoco_leaves_every_option_as_the_library_has_it():
    """MuJoCo's own model, with a step of 0.5 ms, is the truth of options, softness and impedance."""
    mujoco = pytest.importorskip("mujoco")
    from crosscheck.engines.mujoco.simulation import Simulation

    library = mujoco.MjModel.from_xml_string(MODEL.format('<option timestep="5e-4"/>'))
    own = Simulation(SCENE.with_(gravity=library.opt.gravity), Setting("defaults", {"step": 5e-4})).model
    for name in (name for name in dir(library.opt) if not name.startswith("_")):
        given, there = getattr(own.opt, name), getattr(library.opt, name)
        assert callable(there) or np.array_equal(given, there), name
    assert np.array_equal(own.eq_solref[0], library.eq_solref[0])
    assert np.array_equal(own.eq_solimp[0], library.eq_solimp[0])


@pytest.mark.parametrize("name", ["planar_slider_crank", "spatial_slider_crank"])
@pytest.mark.parametrize("family", ["defaults", "trapezoidal", "alpha"])
def test_shown_python_sets_the_settings_of_an_exudyn_run(name, family):
    """The shown line is executed with a recorder in place of Exudyn's system. It makes the settings and the
    solver type that the adapter uses, which differ from Exudyn's defaults."""
    exu = pytest.importorskip("exudyn")
    from crosscheck.engines.exudyn.adapter import DYNAMIC
    from crosscheck.engines.exudyn.dynamic import Solver

    scene = find_scene(name)
    line = engine("exudyn").own_code(scene, Setting(family, {"step": 0.3e-3}))
    settings, wanted, solved = exu.SimulationSettings(), exu.SimulationSettings(), []
    exec(line, {"settings": settings, "exu": exu, "mbs": _Solving(solved)})
    kind = DYNAMIC[family](exu, wanted, Solver(exu, scene).singular)
    wanted.timeIntegration.endTime = scene.duration
    wanted.timeIntegration.numberOfSteps = int(np.ceil(scene.duration / 0.3e-3))
    assert solved == [kind] and str(settings) == str(wanted) != str(exu.SimulationSettings())


class _Solving:
    def __init__(self, solved: list[Any]):
        self.solved = solved

    def SolveDynamic(self, settings: Any, solverType: Any) -> None:
        self.solved.append(solverType)


def test_shown_python_sets_the_solver_of_a_pinocchio_run():
    """The shown code is executed on closures of its own. Then accuracies, iterations, step and the closures'
    Baumgarte gains are those of the adapter's simulation."""
    pinocchio = pytest.importorskip("pinocchio")
    from crosscheck.engines.pinocchio.simulation import Simulation

    for family in ("defaults", "proximal", "baumgarte"):
        asked = Setting(family, {"step": 2e-4})
        own = Simulation(SCENE, asked)
        closures = list(Simulation(SCENE, Setting("proximal", {"step": 2e-4})).mechanism.closures)
        names: dict[str, Any] = {"pinocchio": pinocchio, "closures": closures}
        exec(engine("pinocchio").own_code(SCENE, asked), names)
        for field in ("absolute_accuracy", "mu", "max_iter"):
            assert getattr(names["settings"], field) == getattr(own.solver, field), field
        assert names["h"] == 2e-4 and len(closures) > 0
        for closure, mine in zip(closures, own.closures, strict=True):
            corrector, other = (closure.m_baumgarte_parameters, mine.m_baumgarte_parameters)
            assert np.allclose(corrector.Kp, other.Kp) and np.allclose(corrector.Kd, other.Kd)


def test_shown_python_of_simbody_names_an_integrator_of_opensim():
    """``IntegratorMethod_…`` is an attribute of OpenSim's Manager; the accuracy is the setting's."""
    opensim = pytest.importorskip("opensim")
    line = engine("simbody").own_code(SCENE, Setting("merson", {"accuracy": 1e-6}))
    assert hasattr(opensim.Manager, re.search(r"IntegratorMethod_\w+", line)[0])
    assert line.endswith("manager.setIntegratorAccuracy(1e-06)")


def test_shown_python_of_mbref_runs_with_its_tolerance():
    """The line, evaluated, gives a completed motion with the setting's rtol."""
    line = engine("mbref").own_code(SCENE, Setting("taylor", {"rtol": 1e-6}))
    motion = eval(line, {"mbref": mbref, "scene": SCENE.with_(duration=0.001)})
    assert motion.settings["rtol"] == 1e-6 and motion.outcome.name == "COMPLETED"


@pytest.mark.parametrize("name", ["mujoco", "pinocchio", "exudyn"])
def test_no_code_is_shown_for_families_that_crosscheck_integrates(name):
    """The text is empty. Pinocchio has no integrator: the code of three families sets its solver instead."""
    pytest.importorskip(name)
    found, solved = engine(name), {"pinocchio": {"defaults", "proximal", "baumgarte"}}.get(name, set())
    integrated = set(found.integrated_here) - solved
    options = {"step": 1e-3, "rtol": 1e-6, "min_step": 1e-5}
    assert integrated and not any(found.own_code(SCENE, Setting(family, options)) for family in integrated)


def test_fastest_run_within_the_level_is_chosen_otherwise_the_most_accurate():
    """Engine a has three runs of family "own" within the error 1e-6: the one of 1 s, error 5e-7, is chosen,
    and family "ours" is excluded. Engine b has none within it: the one of least error is chosen."""
    # engine, family, error, seconds
    own = (1e-9, 3.0), (5e-7, 1.0), (1e-7, 2.0)
    runs = [*(("a", "own", *each) for each in own), ("a", "ours", 1e-8, 0.1)]
    runs += [("b", "own", 1e-2, 0.1), ("b", "own", 1e-4, 0.2)]
    numbers = [{"metrics": {"error": error}, "cost": {"seconds": s}} for *_, error, s in runs]
    named = [{"engine": name, "family": family, "outcome": "COMPLETED"} for name, family, *_ in runs]
    records = [one | other for one, other in zip(named, numbers, strict=True)]
    found = Judged(SCENE, {}, records).within(1e-6, lambda r: r["family"] == "own")
    assert {name: r["metrics"]["error"] for name, r in found.items()} == {"a": 5e-7, "b": 1e-4}
