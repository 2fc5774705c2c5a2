"""Many worlds at once: ``python benchmarks/worlds.py [--worlds N …] [ENGINE …]`` for mjx, warp and newton.

Copies of one four-bar, closed by a ball joint, move for 0.1 s in steps of 1 ms. The table has worlds times
steps a second of wall time, and the largest error of any world against the reference. Code is compiled first;
its seconds are beside. Everything runs on the processor.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from crosscheck.engine import Setting, engine
from crosscheck.engines.mujoco.ports import PortedModel
from crosscheck.findings.finding import FOLDER
from crosscheck.judge.truth import truth_for
from mbref.scene import Scene

STEP, COUNT = 1e-3, 100
STOCK = Setting("stock", {"step": STEP})
KAMINO = Setting("lox", {"step": STEP, "alpha": 0.01})
Run = tuple[
    Callable[[], None], Callable[[], np.ndarray]
]  # takes all steps; returns positions (worlds, nb, 3)


def mjx(scene: Scene, worlds: int) -> Run:
    """MJX in double precision; worlds are a batch of data."""
    engine("mjx").prepare(())
    import jax
    from mujoco import mjx as port

    ported = PortedModel(scene, STOCK)
    model, first = port.put_model(ported.model), port.put_data(ported.model, ported.data)
    start = jax.tree.map(lambda part: jax.numpy.stack([part] * worlds), first)
    once = jax.vmap(port.step, in_axes=(None, 0))
    stepped = jax.jit(lambda data: jax.lax.fori_loop(0, COUNT, lambda _, now: once(model, now), data))
    compiled, last = stepped.lower(start).compile(), [start]

    def run() -> None:
        last[0] = compiled(start)
        last[0].qpos.block_until_ready()

    return run, lambda: positions(ported, np.asarray(last[0].qpos), np.asarray(last[0].qvel))


def warp(scene: Scene, worlds: int) -> Run:
    """MuJoCo Warp in single precision."""
    engine("warp").prepare(())
    import mujoco_warp

    ported = PortedModel(scene, STOCK)
    model = mujoco_warp.put_model(ported.model)
    mujoco_warp.step(model, mujoco_warp.put_data(ported.model, ported.data, nworld=worlds))  # compiles
    data = mujoco_warp.put_data(ported.model, ported.data, nworld=worlds)

    def run() -> None:
        for _ in range(COUNT):
            mujoco_warp.step(model, data)

    return run, lambda: positions(ported, data.qpos.numpy(), data.qvel.numpy())


def newton(scene: Scene, worlds: int) -> Run:
    """Newton's Kamino with LOX in single precision."""
    from crosscheck.engines.newton import solvers
    from crosscheck.engines.newton.adapter import JOINTS
    from crosscheck.engines.newton.model import Mechanism
    from crosscheck.engines.spanning_tree import spanning_tree

    mechanism = Mechanism(scene, spanning_tree(scene, JOINTS))
    builder = mechanism.newton.ModelBuilder(gravity=scene.gravity)
    builder.replicate(mechanism.builder, copy_count=worlds)
    model = builder.finalize(device="cpu", skip_validation_joints=True, skip_validation_inertia=True)
    states, control = [model.state(), model.state()], model.control()
    solvers.make(mechanism.newton, model, KAMINO).step(*states, control, None, STEP)  # compiles
    solver, states[0] = solvers.make(mechanism.newton, model, KAMINO), model.state()
    for name in ("joint_qd", "body_qd"):
        values = getattr(mechanism.state, name).numpy()
        getattr(states[0], name).assign(np.concatenate([values] * worlds))

    def run() -> None:
        for _ in range(COUNT):
            solver.step(*states, control, None, STEP)
            states.reverse()

    def places() -> np.ndarray:
        found = states[0].body_q.numpy().reshape(worlds, -1, 7)[:, list(mechanism.tree.own), :3]
        return found.astype(float)

    return run, places


def positions(ported: PortedModel, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
    """Positions (worlds, nb, 3) of the bodies at joint coordinates (worlds, nq)."""
    own = list(ported.built.tree.own)
    return np.array([ported.motion(q, v).position[own].copy() for q, v in zip(qpos, qvel, strict=True)])


ENGINES: dict[str, Callable[[Scene, int], Run]] = {"mjx": mjx, "warp": warp, "newton": newton}


def main() -> None:
    """Print one row for each engine and number of worlds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("engine", nargs="*", default=list(ENGINES), metavar="ENGINE")
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 1024], metavar="N")
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.engine if name not in ENGINES]:
        parser.error(f"{unknown[0]!r} does not step many worlds here; these do: {', '.join(ENGINES)}")
    scene = Scene.from_file(FOLDER / "ball_four_bar.toml").with_(duration=STEP * COUNT)
    truth: Any = truth_for(scene)
    exact = truth.poses(np.array([scene.duration])).position[0]
    print("| engine | version | worlds | worlds × steps a second | largest error (m) | compiled in (s) |")
    print("| --- | --- | --: | --: | --: | --: |")
    for name in arguments.engine:
        for worlds in arguments.worlds:
            begun = time.perf_counter()
            run, places = ENGINES[name](scene, worlds)
            started = time.perf_counter()
            run()
            rate = worlds * COUNT / (time.perf_counter() - started)
            error = np.linalg.norm(places() - exact, axis=-1).max()
            cells = (
                name,
                engine(name).version(),
                str(worlds),
                f"{rate:.2g}",
                f"{error:.1e}",
                f"{started - begun:.0f}",
            )
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
