"""The solvers of Newton by family of settings, as documentation advises or as the library sets them."""

from __future__ import annotations

import warnings
from typing import Any

from crosscheck.engine import Setting

# relative residual at which PADMM ends an iteration; its default, 1e-6, is below the rounding of its numbers
TOLERANCE = 1e-5
DEFAULT_ALPHA, STRONG_ALPHA = 0.01, 0.1  # fraction of a joint error that a step removes
MOREAU, DEFAULTS, MUJOCO = ", moreau", "defaults", "mujoco"
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
}
ALPHAS = {  # of the families of Kamino
    f"padmm{MOREAU}": STRONG_ALPHA,
    f"dvi{MOREAU}": STRONG_ALPHA,
    f"lox{MOREAU}": STRONG_ALPHA,
    "dvi": DEFAULT_ALPHA,
    "lox": DEFAULT_ALPHA,
    DEFAULTS: DEFAULT_ALPHA,
}

OWN_STEPS = {family: {"alpha": ALPHAS[family]} if family in ALPHAS else {} for family in FAMILIES}
BOUND = (f"padmm{MOREAU}", f"dvi{MOREAU}", "dvi", DEFAULTS)  # these need a constraint


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
    family = setting.family
    config = make_config(
        dynamics_solver="padmm" if family == DEFAULTS else family.removesuffix(MOREAU),
        integrator="moreau" if family.endswith(MOREAU) else "euler",
        use_collision_detector=family.endswith(MOREAU),  # as that integrator demands
    )
    config.constraints.alpha = setting.options["alpha"]
    if family != DEFAULTS:
        config.padmm.primal_tolerance = config.padmm.dual_tolerance = TOLERANCE
        config.padmm.compl_tolerance = TOLERANCE
    return config
