"""Right engines of low order, and the same engines with a fault: the example engine with fixed steps. Its
Runge–Kutta method of order 8 is replaced by a method of order 1 or 2 whose steps end at the samples."""

import types
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import OptimizeResult

from crosscheck.engine import Engine

SOURCE = Path(__file__).parents[2] / "examples" / "spatial_engine" / "spatial_engine.py"
Rates = Callable[[float, np.ndarray], np.ndarray]
Step = Callable[[Rates, float, np.ndarray, float, int], np.ndarray]
PARTS = (50, 100, 200)  # steps over the duration, of the settings from coarse to fine
# lines of the example engine that become lines of an engine with fixed steps
FIXED_STEPS = {
    'Setting("dop853", {"rtol": r}) for r in (1e-5, 1e-7, 1e-9)': (
        'Setting("fixed", {"step": scene.duration / n}) for n in PARTS'
    ),
    'rtol, span = setting.options["rtol"], (0.0, float(times[-1]))': 'step = setting.options["step"]',
    'done = solve_ivp(model.rates, span, start, "DOP853", times, events=holds, rtol=rtol, atol=rtol)': (
        "done = with_fixed_steps(model, start, times, step)"
    ),
}
FAULTS = {  # faults of one line
    "gravity has the other sign": (
        "force[:n] = self.mass[:, None] * np.array(self.scene.gravity)",
        "force[:n] = -self.mass[:, None] * np.array(self.scene.gravity)",
    ),
    "gravity acts twice": (
        "force[:n] = self.mass[:, None] * np.array(self.scene.gravity)",
        "force[:n] = 2 * self.mass[:, None] * np.array(self.scene.gravity)",
    ),
    "a moment acts twice": (
        "moment[self.scene.body_index(load.body)] += load.moment",
        "moment[self.scene.body_index(load.body)] += 2 * np.array(load.moment)",
    ),
    "a spring has half its stiffness": (
        "pull = load.stiffness * (length",
        "pull = 0.5 * load.stiffness * (length",
    ),
    "gyroscopic moments are forgotten": (
        "moment[b] -= cross(spin[b], turn[b] @ self.inertia[b] @ turn[b].T @ spin[b])",
        "pass",
    ),
    "armature is ignored": (
        'unknown += ["armatures" for joint in scene.joint if joint.reflected_inertia]',
        "pass",
    ),
}


def euler(rates: Rates, t: float, y: np.ndarray, h: float, bodies: int) -> np.ndarray:
    """Return a step of Euler's method, of order 1."""
    return y + h * rates(t, y)


def symplectic_euler(rates: Rates, t: float, y: np.ndarray, h: float, bodies: int) -> np.ndarray:
    """Return a step of order 1 in which the poses move with the new velocities."""
    poses = slice(0, 7 * bodies)
    moved = y + h * rates(t, y)
    moved[poses] = y[poses]
    moved[poses] += h * rates(t + h, moved)[poses]
    return moved


def midpoint(rates: Rates, t: float, y: np.ndarray, h: float, bodies: int) -> np.ndarray:
    """Return a step of the midpoint rule, of order 2."""
    return y + h * rates(t + h / 2, y + h / 2 * rates(t, y))


def low_order(step: Step, fault: str = "", parts: tuple[int, ...] = PARTS) -> Engine:
    """Return the example engine with a method of low order, right or with one of FAULTS."""
    source = SOURCE.read_text()
    for old, new in (*FIXED_STEPS.items(), *([FAULTS[fault]] if fault else [])):
        assert source.count(old) == 1, f"{old!r} stands {source.count(old)} times"
        source = source.replace(old, new)

    def with_fixed_steps(model, start, times, longest):
        y, t, states, count = start, 0.0, [], 0
        for sample in times:
            n = int(np.ceil((sample - t) / longest))
            for k in range(n):
                y = step(model.rates, t + k * (sample - t) / n, y, (sample - t) / n, model.count)
            t, count = sample, count + n
            states.append(y)
        return OptimizeResult(t=np.array(times), y=np.array(states).T, nfev=12 * count, status=0, message="")

    module = types.ModuleType("low_order")
    vars(module).update(with_fixed_steps=with_fixed_steps, PARTS=parts)
    exec(compile(source, str(SOURCE), "exec"), vars(module))
    return module.ENGINE
