"""Engines without functions for derivatives of accelerations, each with the reason and its owner."""

from __future__ import annotations

from crosscheck.refusals import Cannot, Owner

REASONS = {
    "exudyn": Cannot(
        Owner.ENGINE,
        "Exudyn linearises a system (ComputeODE2Eigenvalues) without the change of constraint forces with "
        "the pose, and has no function for derivatives of constrained accelerations",
    ),
    "simbody": Cannot(
        Owner.ENGINE,
        "Simbody has no function for derivatives of accelerations; its class Differentiator takes "
        "differences of a function that the user writes",
    ),
    "dart": Cannot(
        Owner.ENGINE, "DART has Jacobians and their rates, and no function for derivatives of accelerations"
    ),
    "bullet": Cannot(Owner.ENGINE, "PyBullet has no function for derivatives of accelerations"),
    "ondsel": Cannot(Owner.ENGINE, "OndselSolver has no function for derivatives of accelerations"),
    "sundials": Cannot(
        Owner.MODEL,
        "SUNDIALS integrates equations that crosscheck writes; the accelerations are not its own, and "
        "scikit-SUNDAE does not wrap the sensitivities of CVODES and IDAS",
    ),
    "casadi": Cannot(
        Owner.ADAPTER,
        "the adapter compiles CasADi's code of accelerations without code of their derivatives",
    ),
    "heyoka": Cannot(
        Owner.ADAPTER, "the adapter compiles heyoka's equations of motion without variational equations"
    ),
    "warp": Cannot(
        Owner.ENGINE,
        "MuJoCo Warp compiles its kernels without adjoints (enable_backward is False in all of its modules), "
        "so Warp's tape gives no gradients of a step",
    ),
    "newton": Cannot(
        Owner.ADAPTER,
        "Kamino and MuJoCo Warp, which close loops, compile their kernels without adjoints; XPBD and "
        "SemiImplicit have them, and the adapter does not record their steps on Warp's tape",
    ),
}


def reason(name: str) -> Cannot:
    """Return the reason why an engine has no derivatives; for an engine without one here, its adapter."""
    unknown = Cannot(Owner.ADAPTER, f"{name} declares no function for derivatives (differentiates_by)")
    return REASONS.get(name, unknown)
