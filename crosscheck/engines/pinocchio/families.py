"""Pinocchio's families of settings, and the sweep over their accuracies for a scene."""

from __future__ import annotations

from crosscheck.engine import Alternatives, Setting
from crosscheck.engines.pinocchio import compiled_run
from crosscheck.engines.shared.fixed_steps import turning
from mbref.scene import Scene

BAUMGARTE = 0.1  # decay rate of the closure errors in 1/step, a double root
# at tighter tolerances the noise at singular positions dominates
RTOLS = (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-11)
LEAST_TURN = 0.03  # rad turned within the shortest adaptive step
STEPS = (0.2, 0.06, 0.02, 0.006, 0.002)  # rad turned per fixed step, for each setting
# rad turned per step, for the stabilised family only; in the others closure errors dominate
FINEST = 0.0007
CHOSEN = "chosen"
LCABA, TYPICAL_MU = "lcaba", 1e-6  # the value of mu that its documentation calls typical
ADMM, PGS = "admm", "pgs"
ANCHORED = (ADMM, PGS)
PROXIMAL = ("defaults", "proximal", "baumgarte")  # families of constraintDynamics with fixed steps
IMPULSES, IMPULSES_PGS, COMPLIANT = "impulses", "impulses, pgs", "compliant"
STEPPED = (IMPULSES, IMPULSES_PGS, COMPLIANT)
FIXED = (*PROXIMAL, LCABA, *ANCHORED, *STEPPED)
DOP853_COMPILED, TUNED_COMPILED = "dop853, compiled", "tuned, compiled"
COMPILED = (DOP853_COMPILED, TUNED_COMPILED)
COMPILED_RTOLS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
FAMILIES = {
    "defaults": "the constraint solver with its default settings (no regularisation, one iteration), RK4",
    "proximal": "the solver iterated to convergence, which redundant closures need, RK4",
    "baumgarte": "RK4 with the closures' own Baumgarte terms, double root 0.1/step",
    LCABA: f"RK4 with the loop-constrained articulated body algorithm, mu {TYPICAL_MU:g}",
    ADMM: "RK4 with the point and frame anchors of Pinocchio 4, solved by its ADMM, and Baumgarte terms, "
    "double root 0.1/step",
    PGS: "like admm, solved by its projected Gauss-Seidel",
    IMPULSES: "steps of first order by impulses of ADMM on the anchors, as in Pinocchio's own examples; a "
    "step removes the share kp of a closure's error",
    IMPULSES_PGS: "like impulses, by its projected Gauss-Seidel",
    COMPLIANT: "like impulses, closures with the compliance step² / mean mass, which vanishes with the step",
    "dop853": "DOP853 without stabilisation",
    "tuned": "DOP853, every accepted state projected onto the closures",
    DOP853_COMPILED: "like dop853, without Python: constraintDynamics of its C++ library called by a "
    "compiled DOP853; needs a C++ compiler and the package cmeel-eigen",
    TUNED_COMPILED: "like tuned, without Python; needs a C++ compiler and cmeel-eigen",
    CHOSEN: "like proximal with the solver's parameters mu and iterations, or with another solver",
}
# change of the forces (N), mu, iterations: needed for accelerations near singular positions
CONVERGED = 1e-9, 1e-8, 50
OPTIONS = {
    "step": "time step, s",
    "rtol": "relative tolerance of a step",
    "min_step": "shortest step, s",
    "beta": "decay rate of the closure errors, a double root, 1/s",
    "kp": "share of a closure's error that a step by impulses removes",
    "compliance": "compliance of closures, m/N and rad/(N m)",
    "damping": "damping of closures that have a compliance, N s/m and N m s/rad",
    "mu": "proximal parameter of the constraint solver",
    "iterations": "largest number of its iterations",
    "solver": "constraintDynamics, lcaba, or ADMM, PGS or least squares for the anchors of Pinocchio 4",
}
# with a larger mu the iteration ends early where rows are nearly dependent
DYNAMICS = {"step": 5e-4, "mu": CONVERGED[1], "iterations": 200, "solver": "constraintDynamics"}
ALTERNATIVES = (
    Alternatives(
        {
            "constraintDynamics, mu 1e-8": Setting(CHOSEN, DYNAMICS),
            "constraintDynamics, mu 1e-6": Setting(CHOSEN, {**DYNAMICS, "mu": 1e-6}),
            "constraintDynamics, mu 1e-10": Setting(CHOSEN, {**DYNAMICS, "mu": 1e-10}),
            "lcaba, mu 1e-6": Setting(CHOSEN, {**DYNAMICS, "mu": 1e-6, "solver": LCABA}),
            "anchors, least squares": Setting(CHOSEN, {**DYNAMICS, "solver": "least squares"}),
            "anchors, ADMM": Setting(CHOSEN, {**DYNAMICS, "solver": "ADMM"}),
            "anchors, PGS": Setting(CHOSEN, {**DYNAMICS, "solver": "PGS"}),
        },
        1e-5,  # forces of redundant closures have rounding of 1e-16 / mu
    ),
)


def sweep(scene: Scene, rate: float) -> list[Setting]:
    """Return fixed steps chosen by the angle that a body turns in one step at the fastest rate (rad/s), and
    adaptive steps by relative tolerance.

    Settings are coarse to fine in each family.
    """
    fine = ("baumgarte", *ANCHORED, *STEPPED)
    fixed = [
        Setting(family, {"step": h} | _feedback(scene, family, h))
        for family in FIXED
        for h in turning(scene, rate, (*STEPS, FINEST) if family in fine else STEPS)
    ]
    least = float(f"{LEAST_TURN / rate:.2g}")
    adaptive = [{"rtol": r, "min_step": least} for r in RTOLS]
    compiled = [] if compiled_run.why_not(scene) else _compiled(least)
    return fixed + [Setting(family, o) for family in ("dop853", "tuned") for o in adaptive] + compiled


def _feedback(scene: Scene, family: str, step: float) -> dict[str, float]:
    """Return the options of a family of STEPPED at a step (s)."""
    if family != COMPLIANT:
        return {"kp": 1.0} if family in STEPPED else {}
    mass = sum(body.mass or 0.0 for body in scene.body) / max(len(scene.body), 1)
    return {"compliance": float(f"{step**2 / mass:.2g}"), "damping": 0.0} if mass else {"compliance": 0.0}


def _compiled(least: float) -> list[Setting]:
    """Return the settings of the compiled families; ``least`` is the shortest step (s)."""
    given: list[tuple[str, dict[str, float]]] = [(DOP853_COMPILED, {"beta": 0.0}), (TUNED_COMPILED, {})]
    return [
        Setting(family, {"rtol": rtol, "min_step": least, **options})
        for family, options in given
        for rtol in COMPILED_RTOLS
    ]


def own_code(setting: Setting) -> str:
    """Return the settings of constraintDynamics in steps h of RK4, and the closures' Baumgarte terms."""
    if setting.family not in PROXIMAL or "step" not in setting.options:
        return ""
    step = float(setting.options["step"])
    given = () if setting.family == "defaults" else CONVERGED
    solver = f"settings = pinocchio.ProximalSettings({', '.join(map(repr, given))})"
    root = BAUMGARTE / step
    gains = f"pinocchio.BaumgarteCorrectorParameters({root**2!r}, {2 * root!r})"
    feedback = f"; [c.setBaumgarteCorrectorParameters({gains}) for c in closures]"
    return f"h = {step!r}; {solver}{feedback * (setting.family == 'baumgarte')}"
