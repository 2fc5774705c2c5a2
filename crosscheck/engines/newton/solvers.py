"""The solvers of Newton by family of settings, as documentation advises or as the library sets them."""

from __future__ import annotations

import warnings
from typing import Any

from crosscheck.engine import Alternatives, Setting

# relative residual at which PADMM ends an iteration; its default, 1e-6, is below the rounding of its numbers
TOLERANCE = 1e-5
DEFAULT_ALPHA, STRONG_ALPHA = 0.01, 0.1  # fraction of a joint error that a step removes
MOREAU, DEFAULTS, MUJOCO, CHOSEN = ", moreau", "defaults", "mujoco", "chosen"
FAMILIES = {
    f"padmm{MOREAU}": "Kamino with PADMM to a tolerance of 1e-5 and the midpoint integrator of Moreau",
    f"dvi{MOREAU}": "Kamino with DVI and the midpoint integrator of Moreau",
    f"lox{MOREAU}": "Kamino with LOX and the midpoint integrator of Moreau",
    "dvi": "Kamino with DVI and the first-order integrator Euler",
    "lox": "Kamino with LOX and the first-order integrator Euler",
    DEFAULTS: "Kamino by its defaults: PADMM to a tolerance of 1e-6, Euler",
    MUJOCO: "SolverMuJoCo by its defaults: MuJoCo Warp inside Newton",
    "xpbd": "SolverXPBD by its defaults, 2 iterations",
    "semi-implicit": "SolverSemiImplicit without angular damping; joints are springs and dampers",
    "featherstone": "SolverFeatherstone without angular damping; it does not close loops",
    CHOSEN: "Kamino with the solver, the integrator and the Jacobian of the options",
}
ALPHAS = {  # of the families of Kamino
    f"padmm{MOREAU}": STRONG_ALPHA,
    f"dvi{MOREAU}": STRONG_ALPHA,
    f"lox{MOREAU}": STRONG_ALPHA,
    "dvi": DEFAULT_ALPHA,
    "lox": DEFAULT_ALPHA,
    DEFAULTS: DEFAULT_ALPHA,
}

OWN_STEPS = {
    family: {"alpha": ALPHAS[family]} if family in ALPHAS else {} for family in FAMILIES if family != CHOSEN
}
BOUND = (f"padmm{MOREAU}", f"dvi{MOREAU}", "dvi", DEFAULTS, CHOSEN)  # these need a constraint
PENALTY, MANY = 0.1, 10_000  # of PADMM; with its penalty of 1 it says that it converged where it is 44 % off


def _way(solver: str, integrator: str, **other: Any) -> Setting:
    """Return a way in which Kamino solves the equations of its steps of 1 ms."""
    own = {"solver": solver, "integrator": integrator, "alpha": DEFAULT_ALPHA, **other}
    return Setting(CHOSEN, {"step": 1e-3, **own})


def _ways(integrator: str) -> Alternatives:
    found = {
        "DVI": _way("dvi", integrator),
        "DVI, dense": _way("dvi", integrator, sparse=False),
        "PADMM": _way("padmm", integrator, penalty=PENALTY, iterations=MANY),
    }
    # measured: 4e-3 of PADMM, 4e-5 of a dense Jacobian
    return Alternatives({f"{integrator}, {name}": way for name, way in found.items()}, 1e-2)


ALTERNATIVES = (
    _ways("euler"),
    _ways("moreau"),
    Alternatives(  # LOX removes joint errors whole, roundings of 6e-8 m, too: 0.06 m/s² in a step
        {
            "euler, DVI, whole": _way("dvi", "euler", alpha=1.0),
            "euler, LOX": _way("lox", "euler", tolerance=1e-7, iterations=200),
        },
        0.1,
    ),
)


def make(newton: Any, model: Any, setting: Setting) -> Any:
    """Return the solver of a setting for a model."""
    solvers, family = newton.solvers, setting.family
    if family == MUJOCO:
        with warnings.catch_warnings():  # Newton 1.8 asks for MuJoCo 3.17, and runs with MuJoCo 4.0
            warnings.filterwarnings("ignore", "MuJoCo dependency version mismatch")
            warnings.filterwarnings("ignore", r"set_const_\w+ is deprecated")
            return solvers.SolverMuJoCo(model)
    if family == "xpbd":
        return solvers.SolverXPBD(model)
    if family == "semi-implicit":
        return solvers.SolverSemiImplicit(model, angular_damping=0.0)
    if family == "featherstone":
        return solvers.SolverFeatherstone(model, angular_damping=0.0)
    return solvers.SolverKamino(model, _kamino(solvers.SolverKamino.Config, setting))


def _kamino(make_config: Any, setting: Setting) -> Any:
    family, options = setting.family, setting.options
    solver = "padmm" if family == DEFAULTS else family.removesuffix(MOREAU)
    integrator = options.get("integrator", "moreau" if family.endswith(MOREAU) else "euler")
    config = make_config(
        dynamics_solver=options.get("solver", solver),
        integrator=integrator,
        use_collision_detector=integrator == "moreau",  # as that integrator demands
        sparse_jacobian=options.get("sparse"),
    )
    config.constraints.alpha = options["alpha"]
    padmm, lox = config.padmm, config.lox
    if family not in (DEFAULTS, CHOSEN):
        padmm.primal_tolerance = padmm.dual_tolerance = padmm.compl_tolerance = TOLERANCE
    if "penalty" in options:
        padmm.rho_0, padmm.max_iterations = options["penalty"], options["iterations"]
    if "tolerance" in options:
        lox.position_tolerance = lox.rotation_tolerance = options["tolerance"]
        lox.velocity_tolerance, lox.max_iterations = 10 * options["tolerance"], options["iterations"]
    return config
