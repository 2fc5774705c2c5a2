"""A mechanism of your own as a file: a door with its closer, simulated and drawn as text."""

from pathlib import Path

import numpy as np

import mbref
from mbref import rotations
from mbref.scene import Scene
from mbref.simulation.simulate import simulate

scene = Scene.from_file(Path(__file__).with_name("door_closer.toml"))
counts = mbref.counts(scene)
print(f"{scene.name}: {counts.rows} rows, {counts.redundant} redundant, {counts.degrees_of_freedom} free")

times = np.linspace(0.0, scene.duration, 21)
run = simulate(scene, "mpi-svd+projection", times)
door = run.bodies.index("door")
start = run.orientation[0, door]
opened = np.degrees(rotations.angle_between(run.orientation[:, door], start))
for t, angle in zip(run.times, opened, strict=True):
    print(f"{t:5.2f} s  closed by {angle:5.1f}°  {'#' * round(angle / 2)}")
print(run.outcome.sentence)
