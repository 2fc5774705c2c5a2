"""mbref: reference implementation of the constraint-handling methods of multibody dynamics.

The public names are imported at first access, so that ``import mbref`` takes little time.
"""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from mbref.scene_services import SERVICES

if TYPE_CHECKING:
    from mbref.design.equilibrium import Equilibrium, equilibria, motion_of_mode
    from mbref.ensembles.ensemble import ensemble
    from mbref.equations.diagnosis import Diagnosis, counts, diagnose
    from mbref.input_error import InputError
    from mbref.method import Method, MethodError
    from mbref.motions.error_estimate import ErrorEstimate
    from mbref.motions.motion import Motion
    from mbref.motions.trajectory import Cost, Outcome, Trajectory
    from mbref.scene import Scene, SceneError
    from mbref.scene.variation import Variation, variants
    from mbref.scenes import SCENES, find_scene
    from mbref.simulation.simulate import Limits, simulate

__version__ = "0.2.0"

_PUBLIC = {  # module → its public names
    "design.equilibrium": ("Equilibrium", "equilibria", "motion_of_mode"),
    "ensembles.ensemble": ("ensemble",),
    "equations.diagnosis": ("Diagnosis", "counts", "diagnose"),
    "input_error": ("InputError",),
    "method": ("Method", "MethodError"),
    "motions.error_estimate": ("ErrorEstimate",),
    "motions.motion": ("Motion",),
    "motions.trajectory": ("Cost", "Outcome", "Trajectory"),
    "scene": ("Scene", "SceneError"),
    "scene.variation": ("Variation", "variants"),
    "scenes": ("SCENES", "find_scene"),
    "simulation.simulate": ("Limits", "simulate"),
}
_MODULE_OF = {name: f"mbref.{module}" for module, names in _PUBLIC.items() for name in names}

_SERVICES = {  # functions behind methods of Scene and Motion
    "angles_at_start": "mbref.design.offsets",
    "assembled": "mbref.design.offsets",
    "counts": "mbref.equations.diagnosis",
    "determined_reactions": "mbref.equations.along_trajectory",
    "estimate_error": "mbref.simulation.second_run",
    "still": "mbref.motions.drawing.picture",
    "violations": "mbref.equations.along_trajectory",
}

__all__ = [
    "SCENES",
    "Cost",
    "Diagnosis",
    "Equilibrium",
    "ErrorEstimate",
    "InputError",
    "Limits",
    "Method",
    "MethodError",
    "Motion",
    "Outcome",
    "Scene",
    "SceneError",
    "Trajectory",
    "Variation",
    "counts",
    "diagnose",
    "ensemble",
    "equilibria",
    "find_scene",
    "motion_of_mode",
    "simulate",
    "variants",
]


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF:
        return getattr(import_module(_MODULE_OF[name]), name)
    raise AttributeError(f"module 'mbref' has no attribute {name!r}")


def _call(name: str, *given: Any) -> Any:
    return getattr(import_module(_SERVICES[name]), name)(*given)


SERVICES.update({name: partial(_call, name) for name in _SERVICES})


def __dir__() -> list[str]:
    return sorted([*globals(), *_MODULE_OF])
