"""mbref: reference implementation of the constraint-handling methods of multibody dynamics.

The public names are imported at first access, so that ``import mbref`` takes little time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mbref.simulation import VERSION

if TYPE_CHECKING:
    from mbref.design.along_motion import AlongMotion, along_motion
    from mbref.design.derivatives.at_rest import equilibrium_sensitivities
    from mbref.design.derivatives.at_state import StateDerivatives, state_derivatives
    from mbref.design.derivatives.eigenvalues import EigenvalueSensitivities, eigenvalue_sensitivities
    from mbref.design.derivatives.fit import FitResult, fit
    from mbref.design.derivatives.result import Sensitivities
    from mbref.design.derivatives.sensitivities import sensitivities
    from mbref.design.diagnosis import Diagnosis, diagnose
    from mbref.design.equilibrium import Equilibrium, equilibria, motion_of_mode
    from mbref.design.exchange import exchanges
    from mbref.design.idle_freedoms import idle_freedoms
    from mbref.design.synthesis.result import SynthesisResult
    from mbref.design.synthesis.synthesise import synthesise
    from mbref.ensembles.ensemble import ensemble
    from mbref.equations.counts import counts
    from mbref.equations.matrices import Matrices
    from mbref.equations.offsets import angles_at_start, assembled
    from mbref.input_error import InputError
    from mbref.method import Method, MethodError
    from mbref.motions.drawing.picture import still
    from mbref.motions.drawing.plot import plot
    from mbref.motions.error_estimate import ErrorEstimate
    from mbref.motions.inverse_dynamics import inverse_dynamics
    from mbref.motions.motion import Motion
    from mbref.motions.trajectory import Cost, Outcome, Trajectory
    from mbref.scene import Scene, SceneError
    from mbref.scene.variation import Variation, variants
    from mbref.scenes import SCENES, find_scene
    from mbref.simulation.second_run import with_error_estimate
    from mbref.simulation.simulate import Limits, simulate
    from mbref.simulation.sweep import sweep
    from mbref.simulation.terms import terms

__version__ = VERSION

_PUBLIC = {  # module → its public names
    "design.derivatives.at_rest": ("equilibrium_sensitivities",),
    "design.derivatives.at_state": ("StateDerivatives", "state_derivatives"),
    "design.derivatives.eigenvalues": ("EigenvalueSensitivities", "eigenvalue_sensitivities"),
    "design.derivatives.fit": ("FitResult", "fit"),
    "design.derivatives.result": ("Sensitivities",),
    "design.derivatives.sensitivities": ("sensitivities",),
    "design.along_motion": ("AlongMotion", "along_motion"),
    "design.diagnosis": ("Diagnosis", "diagnose"),
    "design.equilibrium": ("Equilibrium", "equilibria", "motion_of_mode"),
    "design.exchange": ("exchanges",),
    "design.idle_freedoms": ("idle_freedoms",),
    "design.synthesis.result": ("SynthesisResult",),
    "design.synthesis.synthesise": ("synthesise",),
    "ensembles.ensemble": ("ensemble",),
    "equations.counts": ("counts",),
    "equations.matrices": ("Matrices",),
    "equations.offsets": ("angles_at_start", "assembled"),
    "input_error": ("InputError",),
    "method": ("Method", "MethodError"),
    "motions.drawing.picture": ("still",),
    "motions.drawing.plot": ("plot",),
    "motions.error_estimate": ("ErrorEstimate",),
    "motions.inverse_dynamics": ("inverse_dynamics",),
    "motions.motion": ("Motion",),
    "motions.trajectory": ("Cost", "Outcome", "Trajectory"),
    "scene": ("Scene", "SceneError"),
    "scene.variation": ("Variation", "variants"),
    "scenes": ("SCENES", "find_scene"),
    "simulation.second_run": ("with_error_estimate",),
    "simulation.simulate": ("Limits", "simulate"),
    "simulation.sweep": ("sweep",),
    "simulation.terms": ("terms",),
}
_MODULE_OF = {name: f"mbref.{module}" for module, names in _PUBLIC.items() for name in names}

__all__ = [
    "SCENES",
    "AlongMotion",
    "Cost",
    "Diagnosis",
    "EigenvalueSensitivities",
    "Equilibrium",
    "ErrorEstimate",
    "FitResult",
    "InputError",
    "Limits",
    "Matrices",
    "Method",
    "MethodError",
    "Motion",
    "Outcome",
    "Scene",
    "SceneError",
    "Sensitivities",
    "StateDerivatives",
    "SynthesisResult",
    "Trajectory",
    "Variation",
    "along_motion",
    "angles_at_start",
    "assembled",
    "counts",
    "diagnose",
    "eigenvalue_sensitivities",
    "ensemble",
    "equilibria",
    "equilibrium_sensitivities",
    "exchanges",
    "find_scene",
    "fit",
    "idle_freedoms",
    "inverse_dynamics",
    "motion_of_mode",
    "plot",
    "sensitivities",
    "simulate",
    "state_derivatives",
    "still",
    "sweep",
    "synthesise",
    "terms",
    "variants",
    "with_error_estimate",
]


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF:
        return getattr(import_module(_MODULE_OF[name]), name)
    raise AttributeError(f"module 'mbref' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
