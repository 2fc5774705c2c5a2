"""Run one mechanism in every installed engine and print how far each is from the exact motion."""

import numpy as np

import mbref
from crosscheck.cli.request import find_engines
from crosscheck.engine import engine
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from crosscheck.processes.pool import run_isolated
from mbref.scenes import find_scene

scene = find_scene("spatial_slider_crank").with_(duration=0.01)
times = np.linspace(0.0, scene.duration, 11)
truth = truth_for(scene)

print(f"{scene.name}: {mbref.counts(scene)}")
for name in find_engines(None, notice=print):
    simulator = engine(name)
    if cannot := simulator.cannot(scene):
        print(f"{name:10} cannot: {cannot}")
        continue
    setting = simulator.settings(scene)[-1]
    run = run_isolated(name, scene, times, setting, time_limit=60.0)
    error = measure(scene, run, truth)["error"]
    shown = "unknown" if error is None else f"{error:.1e}"  # a run that ends early may have no sample
    print(f"{name:10} {setting.family:28} {run.outcome.label:10} t = {run.t_end:.3g} s, error {shown}")
