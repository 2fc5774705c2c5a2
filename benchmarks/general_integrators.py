"""General-purpose integrators on mbref's own compiled right-hand side: SciPy's, SUNDIALS CVODE and IDA.

The integrators solve the equations of a scene in all coordinates, with accelerations by ALF and without
stabilisation. Only the integrator, which is called from Python, differs from mbref.  IDA is given the
residual y' - f(t, y).
"""

from __future__ import annotations

import math
import os
import time
from abc import abstractmethod
from collections.abc import Sequence
from importlib import metadata

import numpy as np

from crosscheck.engine import Cannot, Engine, Setting
from crosscheck.engines.shared.initial_velocities import lacks_mass
from mbref.kernels.compilation import FLOAT, INT, VECTOR, entry
from mbref.kernels.layout import MEMORY
from mbref.method import Method
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import Scene
from mbref.simulation.runs import start_run
from mbref.stepping.limits import Limits

for kind in ("WARNING", "ERROR"):  # of SUNDIALS: a run that fails says so itself
    os.environ.setdefault(f"SUNLOGGER_{kind}_FILENAME", os.devnull)

METHOD = "alf-dual+none"
RTOLS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
MOST_STEPS = 10**6
LONGEST = 10.0  # s of CPU time after which a run is given up: Radau creeps past singular positions
Solution = tuple[
    np.ndarray, str, int
]  # reached states (k, n), reason of an early end (empty if complete), number of factorisations


@entry(INT(FLOAT, VECTOR, VECTOR, MEMORY))
def rates(t, y, y_rate, memory):
    """y' of the run's method."""
    return memory.kernels.rates(t, y, y_rate, memory)


class TooLong(Exception):
    """A run has taken LONGEST."""


class RightHandSide:
    """y' = f(t, y) of a scene, called from Python: y holds coordinates and velocities.

    Raises TooLong past ``deadline``, a process CPU time.
    """

    def __init__(self, scene: Scene, times: np.ndarray):
        self.run = run = start_run(scene, Method.parse(METHOD), times, Limits())
        self.size, self.counts = int(run.memory.loop.clock.y_size), run.memory.equations.system.counts
        self.start = run.memory.loop.y[: self.size].copy()
        self.deadline = math.inf
        self(0.0, self.start)  # compiled before anything is timed

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        rate = np.empty(self.size)
        if time.process_time() > self.deadline:
            raise TooLong
        rates(t, np.array(y), rate, self.run.packed.argument)
        return rate

    def motion(self, times: np.ndarray, states: np.ndarray) -> dict[str, np.ndarray]:
        """Return poses, velocities and accelerations of the states (k, n), by the names of a Trajectory."""
        nb, state, system = self.run.model.nb, self.run.memory.state, self.run.memory.equations.system
        found = []
        for t, y in zip(times, states, strict=True):
            self(t, y)
            found.append(np.concatenate([state.coordinates, state.velocities, system.acceleration]))
        q, *rates = np.split(np.reshape(found, (-1, 19 * nb)), [7 * nb, 13 * nb], axis=1)
        q = q.reshape(-1, nb, 7)
        q[..., 3:] /= np.linalg.norm(q[..., 3:], axis=-1, keepdims=True)
        return self.run.model.motion(q, *(rate.reshape(-1, nb, 6) for rate in rates))


class GeneralIntegrator(Engine):
    """A library of integrators as an engine; families of settings are its methods, the only option is
    ``rtol``."""

    families: tuple[str, ...]

    def version(self) -> str:
        return metadata.version(self.package)

    def cannot(self, scene: Scene) -> Cannot | None:
        return lacks_mass(scene)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        return [Setting(family, {"rtol": rtol}) for family in self.families for rtol in RTOLS]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        began = time.process_time()
        f = RightHandSide(scene, times)
        built = time.process_time() - began
        f.counts.evaluations = 0
        began = time.process_time()
        f.deadline = began + LONGEST
        try:
            states, message, factorisations = self.solve(setting.family, f, times, setting.options["rtol"])
        except TooLong:
            states, message, factorisations = np.zeros((0, f.size)), f"given up after {LONGEST:g} s", 0
        seconds, f.deadline = time.process_time() - began, math.inf
        cost = Cost(seconds, built, rhs=int(f.counts.evaluations), factorisations=factorisations)
        done = len(states) == len(times) and not message
        motion = f.motion(times[: len(states)], states)
        return Trajectory(
            scene.name,
            self.name,
            self.version(),
            setting.family,
            dict(setting.options),
            times[: len(states)],
            tuple(body.name for body in scene.body),
            **motion,
            outcome=Outcome.COMPLETED if done else Outcome.STEP_FAILED,
            message=message,
            t_end=float(times[len(states) - 1]) if len(states) else 0.0,
            cost=cost,
        )

    @abstractmethod
    def solve(self, family: str, f: RightHandSide, times: np.ndarray, rtol: float) -> Solution:
        """Return the states at the times that were reached."""


class SciPy(GeneralIntegrator):
    """``scipy.integrate.solve_ivp``."""

    name = package = "scipy"
    families = ("DOP853", "Radau")

    def solve(self, family: str, f: RightHandSide, times: np.ndarray, rtol: float) -> Solution:
        from scipy.integrate import solve_ivp

        span = (0.0, float(times[-1]))
        try:
            found = solve_ivp(f, span, f.start, method=family, t_eval=times, rtol=rtol, atol=rtol)
        except ValueError as error:  # Radau's answer to a Jacobian that is not finite
            return np.zeros((0, f.size)), str(error), 0
        return found.y.T, "" if found.success else found.message, found.nlu


class ScikitSundae(GeneralIntegrator):
    """SUNDIALS by scikit-sundae."""

    name, package = "sundials", "scikit-sundae"
    families = ("CVODE Adams", "CVODE BDF", "IDA")

    def solve(self, family: str, f: RightHandSide, times: np.ndarray, rtol: float) -> Solution:
        from sksundae.cvode import CVODE
        from sksundae.ida import IDA

        options = {"rtol": rtol, "atol": rtol, "max_num_steps": MOST_STEPS}

        def rates(t: float, y: np.ndarray, rate: np.ndarray) -> None:
            rate[:] = f(t, y)

        def residual(t: float, y: np.ndarray, rate: np.ndarray, res: np.ndarray) -> None:
            res[:] = rate - f(t, y)

        if family == "IDA":
            found = IDA(residual, **options).solve(times, f.start, f(0.0, f.start))
        else:
            found = CVODE(rates, method=family.split()[1], **options).solve(times, f.start)
        reached = np.isin(times, found.t)
        states = np.asarray(found.y)[np.isin(found.t, times)][: int(reached.sum())]
        return states, "" if found.success else str(found.message), 0


SCIPY, SCIKIT_SUNDAE = SciPy(), ScikitSundae()
