"""MuJoCo's families of settings, and the sweep over their accuracies for a scene.

The hardest closures that MuJoCo's documentation allows have a softness of 1e-4 of the inverse mass; MuJoCo's
default closures are ten times as soft.  The family of settings ``stiff`` loses an order of convergence. After
singular positions, which amplify closure errors, the closure errors of ``stiff`` are smaller.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from crosscheck.engine import Setting
from crosscheck.engines.shared.fixed_steps import turning
from crosscheck.engines.shared.initial_velocities import may_move_freely
from crosscheck.engines.shared.planar_scene import planar_scene
from crosscheck.engines.shared.spanning_tree import spanning_tree
from mbref.scene import Scene

HARD = 1e-7  # factor on the regulariser: relative errors below 1e-9; rounding grows at 1e-8
RK4 = "mjINT_RK4"
STOCK = {
    "stock": RK4,
    "euler": "mjINT_EULER",
    "implicit": "mjINT_IMPLICIT",
    "implicitfast": "mjINT_IMPLICITFAST",
    "discrete": "mjINT_DISCRETE",
}
# decay rate of the closure errors in fastest rates of the scene, a double root; large enough to cross
# singular positions
BETA = 5.0
DEFAULT_STEP = 2e-3  # s
STEPS = (0.15, 0.05, 0.015, 0.005, 0.0015)  # rad turned per step, for each setting; 2 beta step stays below 2
STIFF_STEPS = (0.015, 0.005, 0.0015, 0.0005)
STIFF = 0.2  # decay rate of the stiff closures' errors in 1/step, a double root
RTOLS = (1e-3, 1e-4, 1e-6, 1e-8, 1e-10)  # at tighter tolerances the noise at singular positions dominates
# factor on the regulariser; with smaller factors the accelerations are too noisy
ADAPTIVE = {"forward": 1e-7, "projected": 1e-9}
FORWARD_COMPILED, PROJECTED_COMPILED, NEWTON = "forward, compiled", "projected, compiled", "newton, compiled"
CHOSEN = "chosen"
COMPILED = (FORWARD_COMPILED, PROJECTED_COMPILED, NEWTON)
COMPILED_HARD = {"point": 1e-9, "weld": 1e-7}  # factor on the regulariser; welds are redundant
# decay rate of the closure errors, a double root, in fastest rates and in 1/duration
COMPILED_BETA = 0.1, 10.0
TOLERANCES, NEWTON_TURN = (1e-4, 1e-7, 1e-10, 1e-13), 0.6
COMPILED_RTOLS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
LEAST_TURN = 0.03  # rad turned within the shortest adaptive step
DENSE = "dense Jacobian, no islands"  # in all families but the first one
FAMILIES = {
    "defaults": "the library's own options; the time step alone is given",
    "stock": f"the stiffest documented closures (time constant two steps, impedance 0.9999), RK4; {DENSE}",
    "euler": "like stock, first-order integrator Euler",
    "implicit": "like stock, first-order integrator implicit",
    "implicitfast": "like stock, first-order integrator implicitfast; only where a load damps",
    "discrete": "like stock, first-order integrator discrete, which MuJoCo has since 3.13; without drivers",
    "tuned": "the regulariser made negligible through invweight0, critically damped closures at five "
    "times the "
    f"fastest rate of the scene, RK4, Newton's method iterated to convergence; {DENSE}",
    "stiff": "the tuned model with the stiffest closures that are stable at the step",
    "forward": "the tuned model's accelerations (mj_forward) integrated by DOP853",
    "projected": "like forward; every accepted state is projected onto the closures",
    FORWARD_COMPILED: "like forward, without Python: mj_forward of libmujoco called by a compiled DOP853",
    PROJECTED_COMPILED: "like projected, without Python; closure errors are removed by projection only",
    NEWTON: "Newton's method on MuJoCo's closures, without Python; where drivers prescribe the whole motion",
    CHOSEN: "solver, Jacobian, islands and warm start as the options say, iterated to convergence, Euler; "
    "hard closures where `hard` is given, else the library's",
}
INTEGRATED_HERE = (*ADAPTIVE, *COMPILED)
SOLVING = ("solver", "tolerance", "iterations")  # options that the families of STOCK take
SOLVERS = {
    "jacobian": "dense, sparse or auto",
    "islands": "whether islands are solved apart",
    "warm": "whether the solver starts from the accelerations of the step before",
    "forward": "calls of mj_forward for one sample",
    "parts": "whether mj_step1 and mj_step2 replace mj_step",
}
OPTIONS = SOLVERS | {
    "step": "time step, s",
    "rtol": "relative tolerance of a step",
    "min_step": "shortest step, s",
    "beta": "decay rate of the closure errors, a double root, 1/s",
    "hard": "factor on the regulariser",
    "tolerance": "at which an iteration stops: closure error, m or rad, of the family newton; scaled gain of "
    "MuJoCo's solvers",
    "turn": "rad a driver may move within one step",
}
# impedance parameters; MuJoCo clamps the first two at this value
STIFFEST = (0.9999, 0.9999, 0.001, 0.5, 2.0)
CONVERGED, MOST_ITERATIONS = 1e-20, 50  # scaled gain at which Newton iterations end; two or three are usual
# Python statements to be run after the model's compilation
SCALED = "model.body_invweight0[:] *= {0:g}; model.dof_invweight0[:] *= {0:g}"


def sweep(scene: Scene, rate: float) -> list[Setting]:
    """Return fixed steps chosen by the angle that a body turns in one step at the fastest rate (rad/s), and
    adaptive steps by relative tolerance.

    Settings are coarse to fine in each family.
    """
    beta = _rounded(BETA * rate)
    steps, stiff = (turning(scene, rate, angles) for angles in (STEPS, STIFF_STEPS))
    plain = sorted({DEFAULT_STEP, *steps}, reverse=True)
    return [
        *(Setting("defaults", {"step": h}) for h in plain),
        *(Setting(family, {"step": h}) for family in _stock(scene) for h in steps),
        *(Setting("tuned", {"step": h, "beta": beta, "hard": HARD}) for h in steps),
        *(Setting("stiff", {"step": h, "beta": _rounded(STIFF / h), "hard": HARD}) for h in stiff),
        *_adaptive(scene, rate),
    ]


def depends_on_pieces(scene: Scene) -> bool:
    """Return whether a load changes with time or a driver follows a table."""
    return any(load.over_time for load in scene.load) or any(driver.table for driver in scene.driver)


def _adaptive(scene: Scene, rate: float) -> Iterator[Setting]:
    least, stiff = _rounded(LEAST_TURN / rate), _rounded(BETA * rate)
    of_rate, of_duration = COMPILED_BETA
    slow = _rounded(max(of_rate * rate, of_duration / scene.duration))
    welded = any(closure.kind == "weld" for closure in spanning_tree(planar_scene(scene)).closures)
    hard = COMPILED_HARD["weld" if welded else "point"]
    for family, factor in ADAPTIVE.items():
        yield from _by_rtol(family, RTOLS, least, factor, stiff)
    if depends_on_pieces(scene):
        return  # the compiled families evaluate polynomials and sines of drivers only
    yield from _by_rtol(FORWARD_COMPILED, COMPILED_RTOLS, least, hard, slow)
    yield from _by_rtol(PROJECTED_COMPILED, COMPILED_RTOLS, least, hard, None)
    if scene.driver and not may_move_freely(scene):
        yield from (
            Setting(NEWTON, {"tolerance": tolerance, "turn": NEWTON_TURN}) for tolerance in TOLERANCES
        )


def _by_rtol(
    family: str, rtols: Sequence[float], shortest: float, hard: float, beta: float | None
) -> Iterator[Setting]:
    rate = {} if beta is None else {"beta": beta}
    for rtol in rtols:
        yield Setting(family, {"rtol": rtol, "min_step": shortest, **rate, "hard": hard})


def _rounded(number: float) -> float:
    return float(f"{number:.2g}")


def _stock(scene: Scene) -> list[str]:
    """Return the families with default closures whose integrators MuJoCo has and differ on the scene.

    The integrator discrete does not use the reference accelerations that the adapter writes for drivers.
    """
    import mujoco

    is_damped = any(load.is_damped for load in scene.load)
    known = [family for family, name in STOCK.items() if hasattr(mujoco.mjtIntegrator, name)]
    known = [family for family in known if family != "discrete" or not scene.driver]
    return [family for family in known if is_damped or family != "implicitfast"]


def own_code(setting: Setting) -> str:
    """Return the MJCF of a setting that MuJoCo integrates, and Python statements for options that MJCF does
    not have."""
    family, options = setting.family, setting.options
    if family in (*INTEGRATED_HERE, CHOSEN):
        return ""
    step = options.get("step", DEFAULT_STEP)
    attributes = {"timestep": f"{step!r}"}
    if family == "defaults":
        kind = f' jacobian="{options["jacobian"]}"' if "jacobian" in options else ""
        return f'<option timestep="{step!r}"{kind}/>'
    flags = {"autoreset": "disable"}
    integrator = STOCK.get(family, RK4).removeprefix("mjINT_")
    attributes |= {"integrator": NAMES.get(integrator, integrator), "jacobian": "dense"}
    attributes |= {name: str(options[name]) for name in SOLVING if name in options and family in STOCK}
    flags["island"] = "disable"
    if family in STOCK:
        return _option(attributes, flags) + _closures(2 * step, 1.0)
    attributes |= {"iterations": str(MOST_ITERATIONS), "tolerance": repr(CONVERGED)}
    flags["refsafe"] = "disable"
    beta = options.get("beta", 0.0)
    hardened = SCALED.format(options.get("hard", HARD))
    return f"{_option(attributes, flags)}{_closures(-(beta**2), -2 * beta)} and in Python: {hardened}"


IN_MJCF = ("Euler", "implicit", "implicitfast", "discrete")
NAMES = {name.upper(): name for name in IN_MJCF}


def _option(attributes: Mapping[str, str], flags: Mapping[str, str]) -> str:
    own, switched = (" ".join(f'{k}="{v}"' for k, v in names.items()) for names in (attributes, flags))
    return f"<option {own}><flag {switched}/></option>"


def _closures(first: float, second: float) -> str:
    """Return the stiffness of all equalities as MJCF: solref, and the hardest impedance."""
    impedance = " ".join(map(repr, STIFFEST))
    return f'<default><equality solref="{first!r} {second!r}" solimp="{impedance}"/></default>'
