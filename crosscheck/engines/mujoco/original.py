"""The model of an MJCF file itself, at its own settings, at smaller time steps and with stiffer closures.

Contacts, limits and dry friction are off, and controls are constant, as in the scene that was read from the
file.  The run keeps the file's time step: a sample between two steps is reached by one shorter step from
the last step.
"""

from __future__ import annotations

import argparse
import shlex
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engine import Setting
from crosscheck.engines.mujoco.families import STIFFEST
from crosscheck.engines.mujoco.importing.reading import Source, source
from crosscheck.engines.mujoco.options import change, keyword
from crosscheck.engines.mujoco.warnings_off import check_state, without_warnings
from crosscheck.engines.shared.fixed_steps import MOST_STEPS
from crosscheck.engines.shared.sampling import Counts, Sample, run_through
from crosscheck.setting import AS_IN_FILE
from mbref.formats import ImportOptions, OriginalRun, add_options, import_options
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

FINER, STIFFER, STIFFER_RK4 = "as in file, finer", "as in file, stiffer", "as in file, stiffer, RK4"
OFF = "contacts, limits and dry friction are off"
FAMILIES = {
    AS_IN_FILE: f"the file's own model, time step, integrator, solver, solref and solimp; {OFF}",
    FINER: "as in file, with smaller time steps",
    STIFFER: "as in file, with smaller time steps and the stiffest documented closures at the step",
    STIFFER_RK4: "as in file, stiffer, with the integrator RK4",
}
OPTIONS = {
    "file": "the file that the model is read from",
    "import": "options for reading it",
    "integrator": "integrator of the file",
    "solver": "solver of the file",
    "iterations": "most iterations of the solver",
    "solref": "time constant (s) and damping ratio of the closures, or stiffness and damping if negative",
    "solimp": "impedance of the closures",
}
DIVISORS = (1, 2, 5, 10, 20, 50)  # the file's time step over the smaller ones
ON_GRID = 1e-9  # fraction of a step: a sample so near a step is at the step


def originals(path: Path, options: ImportOptions, read: Source) -> tuple[OriginalRun, ...]:
    """Return the runs of an MJCF file that was read; no runs if ``--close`` closed further loops."""
    if path.suffix != ".xml" or options.close:
        return ()
    where: dict[str, Any] = {"file": str(path.resolve())}
    if words := options.words():
        where["import"] = shlex.join(words)
    own, duration = own_settings(read.original), read.imported.scene.duration
    steps = [own["step"] / k for k in DIVISORS if duration * k / own["step"] <= MOST_STEPS] or [own["step"]]
    return (
        OriginalRun("mujoco", AS_IN_FILE, {**where, **own}),
        *(
            OriginalRun("mujoco", family, {**where, "step": step})
            for family in (FINER, STIFFER, STIFFER_RK4)
            for step in steps
        ),
    )


def own_settings(model: Any) -> dict[str, Any]:
    """Return the settings of a model that decide its errors; solref and solimp if all closures share them."""
    import mujoco

    found = {
        "step": float(model.opt.timestep),
        "integrator": keyword(mujoco.mjtIntegrator(model.opt.integrator)),
        "solver": keyword(mujoco.mjtSolver(model.opt.solver)),
        "iterations": int(model.opt.iterations),
    }
    active = model.eq_active0.astype(bool)
    for name, rows in (("solref", model.eq_solref[active]), ("solimp", model.eq_solimp[active])):
        if len(rows) and np.all(rows == rows[0]):
            found[name] = " ".join(f"{number:.15g}" for number in rows[0])
    return found


def own_code(setting: Setting) -> str:
    """Return the MJCF that makes a setting of these families; empty for the file's own settings."""
    if setting.family not in (FINER, STIFFER, STIFFER_RK4):
        return ""
    step = setting.options["step"]
    rk4 = ' integrator="RK4"' if setting.family == STIFFER_RK4 else ""
    text = f'<option timestep="{step!r}"{rk4}/>'
    if setting.family == FINER:
        return text
    impedance = " ".join(map(repr, STIFFEST))
    return f'{text}<default><equality solref="{2 * step!r} 1" solimp="{impedance}"/></default>'


def run(scene: Scene, times: np.ndarray, setting: Setting, version: str) -> Trajectory:
    """Simulate the model of the setting's file; ``scene`` names the bodies.

    Raises SceneError if the file has other bodies than the scene, ValueError without a file.
    """
    import mujoco

    if "file" not in setting.options:
        raise ValueError(f"settings of the family {setting.family!r} need the option 'file'")
    start = time.process_time()
    original = _Original(mujoco, setting)
    labels = {"engine": "mujoco", "version": version, "method": setting.family, "settings": original.settings}
    with without_warnings(mujoco), np.errstate(all="ignore"):
        built = time.process_time() - start
        return run_through(scene, times, original.advance, original.sample, original.counts, built, labels)


class _Original:
    """One simulation of a file's model."""

    def __init__(self, mujoco: Any, setting: Setting):
        path, options = Path(setting.options["file"]), _import_options(setting.options)
        read = source(path, options)
        self.mujoco, self.model, self.counts = mujoco, read.original, Counts()
        self.groups = read.groups
        bits = mujoco.mjtDisableBit
        for name in ("CONTACT", "LIMIT", "FRICTIONLOSS"):
            self.model.opt.disableflags |= getattr(bits, f"mjDSBL_{name}")
        change(mujoco, self.model, setting.options)
        self.step = float(self.model.opt.timestep)
        if setting.family in (STIFFER, STIFFER_RK4):
            self.model.eq_solref[:], self.model.eq_solimp[:] = (2 * self.step, 1.0), STIFFEST
        if setting.family == STIFFER_RK4:
            self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self.settings = own_settings(self.model) | dict(setting.options)
        self.data, self.between = mujoco.MjData(self.model), mujoco.MjData(self.model)
        self.data.qpos[:], self.data.qvel[:] = read.qpos, read.qvel
        read.actuators.prepare(self.data)

    def advance(self, t0: float, t1: float) -> None:
        """Step to the last step before t1, and from a copy of it to t1; raises Failed."""
        mujoco, model, data = self.mujoco, self.model, self.data
        left = t1 - data.time
        whole = max(0, int(np.floor(left / self.step + ON_GRID)))
        if whole:
            reached = data.time + whole * self.step
            mujoco.mj_step(model, data, nstep=whole)
            data.time = reached
            self._count(whole)
        mujoco.mj_copyData(self.between, model, data)
        if (rest := t1 - data.time) > ON_GRID * self.step:
            model.opt.timestep = rest
            mujoco.mj_step(model, self.between)
            model.opt.timestep = self.step
            self._count(1)
        check_state(mujoco, self.between, t0, t1)

    def _count(self, steps: int) -> None:
        rk4 = self.model.opt.integrator == self.mujoco.mjtIntegrator.mjINT_RK4
        self.counts.steps += steps
        self.counts.rhs += 4 * steps if rk4 else steps

    def sample(self, t: float) -> Sample:
        """Return poses, velocities and accelerations of the scene's bodies."""
        data = self.data if t == 0 else self.between
        self.mujoco.mj_forward(self.model, data)
        placed = [self.groups.placed(data, piece) for piece in self.groups.pieces]
        twists = np.array([p.jacobian @ data.qvel for p in placed])
        changes = np.array(
            [
                p.jacobian @ data.qacc + self.groups.drift(data, piece)
                for piece, p in zip(self.groups.pieces, placed, strict=True)
            ]
        )
        return Sample(
            position=np.array([p.position for p in placed]),
            orientation=np.array([p.orientation for p in placed]),
            velocity=twists[:, :3],
            angular_velocity=twists[:, 3:],
            acceleration=changes[:, :3],
            angular_acceleration=changes[:, 3:],
        )


def _import_options(options: Mapping[str, Any]) -> ImportOptions:
    parser = argparse.ArgumentParser(add_help=False)
    add_options(parser)
    return import_options(parser.parse_args(shlex.split(str(options.get("import", "")))))
