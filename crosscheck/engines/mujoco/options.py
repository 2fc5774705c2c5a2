"""Options of MuJoCo's models by the words of MJCF."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def keyword(kind: Any) -> str:
    """Return the word of MJCF for an integrator or a solver."""
    name = str(kind.name.split("_", 1)[1])
    return {"EULER": "Euler", "NEWTON": "Newton"}.get(name, name.lower() if len(name) > 3 else name)


def change(mujoco: Any, model: Any, options: Mapping[str, Any]) -> None:
    """Give a model the settings among some options; a ValueError names an option that MuJoCo does not
    have."""
    model.opt.timestep = float(options.get("step", model.opt.timestep))
    model.opt.iterations = int(options.get("iterations", model.opt.iterations))
    model.opt.tolerance = float(options.get("tolerance", model.opt.tolerance))
    keywords = {
        "integrator": mujoco.mjtIntegrator,
        "solver": mujoco.mjtSolver,
        "jacobian": mujoco.mjtJacobian,
    }
    for name, kinds in keywords.items():
        known = {keyword(kind): kind for kind in kinds.__members__.values()}
        if name in options:
            if options[name] not in known:
                raise ValueError(f"option {name}: {options[name]!r} is none of {', '.join(known)}")
            setattr(model.opt, name, known[options[name]])
    for name, rows in (("solref", model.eq_solref), ("solimp", model.eq_solimp)):
        if name in options:
            numbers = [float(word) for word in str(options[name]).split()]
            rows[:, : len(numbers)] = numbers
