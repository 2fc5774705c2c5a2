"""Sweeps of the engines / the settings of stored records: a record is found again by its setting alone.

Each line has the options in which the settings of a family differ, from coarse to fine, and then the others.
The steps of ``four_bar`` are smaller than ``planar_slider_crank_gravity``'s because its rates are larger.
"""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from crosscheck.engine import Setting, engine
from mbref.scenes import SCENES

PACKAGES = {
    "mujoco": "mujoco",
    "pinocchio": "pinocchio",
    "exudyn": "exudyn",
    "simbody": "opensim",
    "sundials": "sksundae",
    "ondsel": "pyondsel",
    "casadi": "casadi",
    "heyoka": "heyoka",
}

OF_MBREF = {  # of both scenes
    "taylor": "rtol 0.001 1e-5 1e-7 1e-9 1e-10 1e-11",
    "taylor, generated": "rtol 0.001 1e-5 1e-7 1e-9 1e-10 1e-11",
    "alf-dual+projection": "rtol 0.001 1e-5 1e-7 1e-9 1e-10 1e-11",
    "mpi-svd+partitioning": "rtol 0.001 1e-5 1e-7 1e-9 1e-10 1e-11",
    "mpi-svd+projection": "rtol 0.001 1e-5 1e-7 1e-9 1e-10 1e-11",
    "mpi-svd+none": "rtol 0.001 1e-5 1e-7 1e-9 1e-10 1e-11",
    "mpi-qr+projection": "rtol 0.001 1e-5 1e-7 1e-9 1e-10 1e-11",
}
GRAVITY = {  # of planar_slider_crank_gravity
    "mbref": OF_MBREF,
    "mujoco": {
        "defaults": "step 0.0032 0.002 0.0011 0.00032 0.00011 3.2e-5",
        "stock": "step 0.0032 0.0011 0.00032 0.00011 3.2e-5",
        "euler": "step 0.0032 0.0011 0.00032 0.00011 3.2e-5",
        "implicit": "step 0.0032 0.0011 0.00032 0.00011 3.2e-5",
        "tuned": "step 0.0032 0.0011 0.00032 0.00011 3.2e-5; beta 230; hard 1e-7",
        "stiff": "step 0.00032 0.00011 3.2e-5 1.1e-5; beta 620 1800 6300 18000; hard 1e-7",
        "forward": "rtol 0.001 0.0001 1e-6 1e-8 1e-10; min_step 0.00065; beta 230; hard 1e-7",
        "projected": "rtol 0.001 0.0001 1e-6 1e-8 1e-10; min_step 0.00065; beta 230; hard 1e-9",
        "forward, compiled": "rtol 0.001 1e-5 1e-7 1e-9 1e-11; min_step 0.00065; beta 10; hard 1e-9",
        "projected, compiled": "rtol 0.001 1e-5 1e-7 1e-9 1e-11; min_step 0.00065; hard 1e-9",
    },
    "pinocchio": {
        "defaults": "step 0.0043 0.0013 0.00043 0.00013 4.3e-5",
        "proximal": "step 0.0043 0.0013 0.00043 0.00013 4.3e-5",
        "baumgarte": "step 0.0043 0.0013 0.00043 0.00013 4.3e-5 1.5e-5",
        "dop853": "rtol 0.001 0.0001 1e-6 1e-8 1e-10 1e-11; min_step 0.00065",
        "tuned": "rtol 0.001 0.0001 1e-6 1e-8 1e-10 1e-11; min_step 0.00065",
        "dop853, compiled": "rtol 0.001 1e-5 1e-7 1e-9 1e-11; min_step 0.00065; beta 0",
        "tuned, compiled": "rtol 0.001 1e-5 1e-7 1e-9 1e-11; min_step 0.00065",
    },
    "exudyn": {
        "defaults": "step 0.01 0.0025 0.000625 0.00015625 3.90625e-5",
        "tuned": "step 0.0087 0.0032 0.0011 0.00032 0.00013",
        "trapezoidal": "step 0.01 0.0025 0.000625 0.00015625 3.90625e-5",
        "alpha": "step 0.01 0.0025 0.000625 0.00015625 3.90625e-5",
    },
    "simbody": {
        "merson": "accuracy 0.01 0.001 0.0001 1e-6 1e-8 1e-10",
        "feldberg": "accuracy 0.01 0.001 0.0001 1e-6 1e-8 1e-10",
        "cpodes": "accuracy 0.01 0.001 0.0001 1e-6 1e-8 1e-10",
    },
    "sundials": {
        "ggl": "rtol 0.001 0.0001 1e-5 1e-6 1e-7 1e-8 1e-9",
    },
    "casadi": {
        "projected, compiled": "rtol 0.001 0.0001 1e-5 1e-6 1e-7 1e-8 1e-9 1e-10 1e-11; min_step 0.00037",
        "dop853, compiled": (
            "rtol 0.001 0.0001 1e-5 1e-6 1e-7 1e-8 1e-9 1e-10 1e-11; min_step 0.00037; beta 0.1"
        ),
    },
    "heyoka": {
        "taylor": "rtol 0.001 0.0001 1e-5 1e-6 1e-8 1e-10 1e-12",
    },
}
DRIVEN = {  # of four_bar
    "mbref": OF_MBREF,
    "mujoco": {
        "defaults": "step 0.002 0.0012 0.0004 0.00012 4e-5 1.2e-5",
        "stock": "step 0.0012 0.0004 0.00012 4e-5 1.2e-5",
        "euler": "step 0.0012 0.0004 0.00012 4e-5 1.2e-5",
        "implicit": "step 0.0012 0.0004 0.00012 4e-5 1.2e-5",
        "tuned": "step 0.0012 0.0004 0.00012 4e-5 1.2e-5; beta 620; hard 1e-7",
        "stiff": "step 0.00012 4e-5 1.2e-5 4e-6; beta 1700 5000 17000 50000; hard 1e-7",
        "forward": "rtol 0.001 0.0001 1e-6 1e-8 1e-10; min_step 0.00024; beta 620; hard 1e-7",
        "projected": "rtol 0.001 0.0001 1e-6 1e-8 1e-10; min_step 0.00024; beta 620; hard 1e-9",
        "forward, compiled": "rtol 0.001 1e-5 1e-7 1e-9 1e-11; min_step 0.00024; beta 100; hard 1e-9",
        "projected, compiled": "rtol 0.001 1e-5 1e-7 1e-9 1e-11; min_step 0.00024; hard 1e-9",
        "newton, compiled": "tolerance 0.0001 1e-7 1e-10 1e-13; turn 0.6",
    },
    "pinocchio": {
        "defaults": "step 0.0016 0.00048 0.00016 4.8e-5 1.6e-5",
        "proximal": "step 0.0016 0.00048 0.00016 4.8e-5 1.6e-5",
        "baumgarte": "step 0.0016 0.00048 0.00016 4.8e-5 1.6e-5 5.6e-6",
        "dop853": "rtol 0.001 0.0001 1e-6 1e-8 1e-10 1e-11; min_step 0.00024",
        "tuned": "rtol 0.001 0.0001 1e-6 1e-8 1e-10 1e-11; min_step 0.00024",
        "dop853, compiled": "rtol 0.001 1e-5 1e-7 1e-9 1e-11; min_step 0.00024; beta 0",
        "tuned, compiled": "rtol 0.001 1e-5 1e-7 1e-9 1e-11; min_step 0.00024",
    },
    "exudyn": {
        "defaults": "step 0.001 0.00025 6.25e-5 1.5625e-5",
        "tuned": "step 0.0032 0.0012 0.0004 0.00012 4.8e-5",
        "trapezoidal": "step 0.001 0.00025 6.25e-5 1.5625e-5",
        "alpha": "step 0.001 0.00025 6.25e-5 1.5625e-5",
        "static": "step 0.001 0.00025 6.25e-5",
    },
    "simbody": {
        "merson": "accuracy 0.01 0.001 0.0001 1e-6 1e-8 1e-10",
        "feldberg": "accuracy 0.01 0.001 0.0001 1e-6 1e-8 1e-10",
        "cpodes": "accuracy 0.01 0.001 0.0001 1e-6 1e-8 1e-10",
    },
    "sundials": {
        "ggl": "rtol 0.001 0.0001 1e-5 1e-6 1e-7 1e-8 1e-9",
    },
    "ondsel": {
        "kinematics": "step 0.001 0.00025 6.25e-5",
    },
}


def line(settings: list[Setting]) -> str:
    """The settings of a family in a line."""
    texts = {
        name: [f"{s.options[name]:.12g}".replace("e-0", "e-") for s in settings]
        for name in settings[0].options
    }
    varied = {name: values for name, values in texts.items() if len(set(values)) > 1}
    fixed = [f"{name} {values[0]}" for name, values in texts.items() if name not in varied]
    return "; ".join([*(f"{name} {' '.join(values)}" for name, values in varied.items()), *fixed])


@pytest.mark.parametrize(
    ("scene", "name"),
    [("planar_slider_crank_gravity", name) for name in GRAVITY] + [("four_bar", name) for name in DRIVEN],
)
def test_settings_of_each_family_coarse_to_fine(scene, name):
    if not find_spec(PACKAGES.get(name, name)):
        pytest.skip(f"{PACKAGES[name]} is not installed")
    families: dict[str, list[Setting]] = {}
    for setting in engine(name).settings(SCENES[scene]()):
        families.setdefault(setting.family, []).append(setting)
    wanted = (GRAVITY if scene == "planar_slider_crank_gravity" else DRIVEN)[name]
    assert {family: line(found) for family, found in families.items()} == wanted
