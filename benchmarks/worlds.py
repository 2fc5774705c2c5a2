"""Many worlds at once: ``python benchmarks/worlds.py [ENGINE …] [--worlds N …]`` for mjx, warp and newton.

Copies of one four-bar, closed by a ball joint, take steps of 1 ms. Everything runs on the processor. The runs
of the engines are interleaved, ROUNDS times. The table has worlds times steps a second of wall time of the
fastest round, and the largest error of any world against the reference. Code is compiled first; its seconds
of wall time are beside. Warp's steps are recorded and replayed, as in crosscheck's adapters.
"""

import argparse
import itertools
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from crosscheck.engine import Setting, engine
from crosscheck.engines.mujoco.ports import PortedModel
from crosscheck.engines.shared.warp_graphs import recorded
from crosscheck.findings.finding import FOLDER
from crosscheck.judge.truth import truth_for
from mbref.scene import Scene

STEP, ROUNDS = 1e-3, 3
STOCK = Setting("stock", {"step": STEP})
KAMINO = Setting("lox", {"step": STEP, "alpha": 0.01})
# takes all steps from the start; returns positions (worlds, nb, 3)
Run = tuple[Callable[[], None], Callable[[], np.ndarray]]


def mjx(scene: Scene, worlds: int, count: int) -> Run:
    """MJX in double precision; worlds are a batch of data."""
    engine("mjx").prepare(())
    import jax
    from mujoco import mjx as port

    ported = PortedModel(scene, STOCK)
    model, first = port.put_model(ported.model), port.put_data(ported.model, ported.data)
    start = jax.tree.map(lambda part: jax.numpy.stack([part] * worlds), first)
    once = jax.vmap(port.step, in_axes=(None, 0))
    stepped = jax.jit(lambda data: jax.lax.fori_loop(0, count, lambda _, now: once(model, now), data))
    compiled, last = stepped.lower(start).compile(), [start]

    def run() -> None:
        last[0] = compiled(start)
        last[0].qpos.block_until_ready()

    return run, lambda: positions(ported, np.asarray(last[0].qpos), np.asarray(last[0].qvel))


def warp(scene: Scene, worlds: int, count: int) -> Run:
    """MuJoCo Warp in single precision."""
    engine("warp").prepare(())
    import mujoco_warp

    ported = PortedModel(scene, STOCK)
    model = mujoco_warp.put_model(ported.model)
    mujoco_warp.step(model, mujoco_warp.put_data(ported.model, ported.data, nworld=worlds))  # compiles
    data = mujoco_warp.put_data(ported.model, ported.data, nworld=worlds)
    once = recorded(lambda: mujoco_warp.step(model, data))
    start = data.qpos.numpy().copy(), data.qvel.numpy().copy()  # the arrays of Warp share their memory

    def run() -> None:
        data.qpos.assign(start[0])
        data.qvel.assign(start[1])
        data.qacc_warmstart.zero_()
        for _ in range(count):
            once()

    return run, lambda: positions(ported, data.qpos.numpy(), data.qvel.numpy())


def newton(scene: Scene, worlds: int, count: int) -> Run:
    """Newton's Kamino with LOX in single precision; ``count`` is even."""
    from crosscheck.engines.newton import solvers
    from crosscheck.engines.newton.adapter import JOINTS
    from crosscheck.engines.newton.model import Mechanism
    from crosscheck.engines.shared.spanning_tree import spanning_tree

    mechanism = Mechanism(scene, spanning_tree(scene, JOINTS))
    builder = mechanism.newton.ModelBuilder(gravity=scene.gravity)
    builder.replicate(mechanism.builder, copy_count=worlds)
    model = builder.finalize(device="cpu", skip_validation_joints=True, skip_validation_inertia=True)
    states, control = [model.state(), model.state()], model.control()
    solver = solvers.make(mechanism.newton, model, KAMINO)
    solver.step(*states, control, None, STEP)  # compiles, and sets up the solver's memory
    start = {name: getattr(states[0], name).numpy().copy() for name in ("body_q", "joint_q")}
    for name in ("joint_qd", "body_qd"):
        start[name] = np.concatenate([getattr(mechanism.state, name).numpy()] * worlds)

    def twice() -> None:
        for pair in (states, states[::-1]):
            solver.step(*pair, control, None, STEP)

    both = recorded(twice)

    def run() -> None:
        for name, values in start.items():
            getattr(states[0], name).assign(values)
        for _ in range(count // 2):
            both()

    def places() -> np.ndarray:
        found = states[0].body_q.numpy().reshape(worlds, -1, 7)[:, list(mechanism.tree.own), :3]
        return found.astype(float)

    return run, places


def positions(ported: PortedModel, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
    """Positions (worlds, nb, 3) of the bodies at joint coordinates (worlds, nq)."""
    own = list(ported.built.tree.own)
    return np.array([ported.motion(q, v).position[own].copy() for q, v in zip(qpos, qvel, strict=True)])


ENGINES: dict[str, Callable[[Scene, int, int], Run]] = {"mjx": mjx, "warp": warp, "newton": newton}


def main() -> None:
    """Print one row for each engine and number of worlds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("engine", nargs="*", default=list(ENGINES), metavar="ENGINE")
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 1024], metavar="N")
    parser.add_argument("--steps", type=int, default=100, metavar="N", help="an even number; default: 100")
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.engine if name not in ENGINES]:
        parser.error(f"{unknown[0]!r} does not step many worlds here; these do: {', '.join(ENGINES)}")
    count = arguments.steps
    scene = Scene.from_file(FOLDER / "ball_four_bar.toml").with_(duration=STEP * count)
    truth: Any = truth_for(scene)
    exact = truth.poses(np.array([scene.duration])).position[0]
    print("| engine | version | worlds | worlds × steps a second | largest error (m) | compiled in (s) |")
    print("| --- | --- | --: | --: | --: | --: |")
    for worlds in arguments.worlds:
        for name, row in measured(scene, arguments.engine, worlds, count, exact).items():
            rate, error, compiled = row
            cells = (name, engine(name).version(), worlds, f"{rate:.2g}", f"{error:.1e}", f"{compiled:.0f}")
            print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def measured(
    scene: Scene, names: Sequence[str], worlds: int, count: int, exact: np.ndarray
) -> dict[str, tuple[float, float, float]]:
    """Worlds times steps a second, largest error (m) and s of compilation, by engine."""
    runs: dict[str, Run] = {}
    compiled, least, errors = {}, dict.fromkeys(names, np.inf), dict.fromkeys(names, 0.0)
    for name in names:
        begun = time.perf_counter()
        runs[name] = ENGINES[name](scene, worlds, count)
        compiled[name] = time.perf_counter() - begun
    for _, (name, (run, places)) in itertools.product(range(ROUNDS), runs.items()):
        started = time.perf_counter()
        run()
        least[name] = min(least[name], time.perf_counter() - started)
        errors[name] = max(errors[name], float(np.linalg.norm(places() - exact, axis=-1).max()))
    return {name: (worlds * count / least[name], errors[name], compiled[name]) for name in names}


if __name__ == "__main__":
    main()
