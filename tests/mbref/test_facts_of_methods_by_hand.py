"""Facts of formulations, stabilisations and integrators, as their sources state them; kernels of a method."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from mbref.formulations import FORMULATIONS
from mbref.integrators import INTEGRATORS
from mbref.kernels.scene_layout import (
    ABOUT_AXIS,
    ALONG_AXIS,
    COUPLED_ANGLE,
    COUPLED_SLIDE,
    DISTANCE,
    DOT1,
    DOT2,
    FORCE,
    MOMENT,
    POINT,
    SPRING,
    Bodies,
    Functions,
    Loads,
    Primitives,
    SceneData,
)
from mbref.method import Method
from mbref.simulation import start_run as starting
from mbref.stabilisation import STABILISATIONS, all_coordinates, partitioning, projection
from mbref.stepping import preparation
from mbref.taylor import preparation as of_series

REGULARISED = "by regularisation"
FACTS = {  # redundant rows, bodies without inertia, crossings, independent columns, all rows, sparse
    "lm1": (False, True, "no", False, False, False),
    "lm2": (False, False, "no", False, False, False),
    "alf": (True, True, REGULARISED, False, True, False),
    "alf-dual": (True, False, REGULARISED, False, False, True),
    "mpi-svd": (True, False, "no", False, False, False),
    "mpi-gs": (True, False, "no", False, False, False),
    "mpi-gs-literal": (True, False, "no", True, False, False),
    "mpi-qr": (True, False, "no", False, False, False),
}


def test_claims_of_formulations():
    """Penalties replace pivots and weight rows; pseudo-inverses divide by the mass; the printed Gram–Schmidt
    inverts a square matrix."""
    found = {
        name: (
            f.handles_redundancy,
            f.handles_singular_mass,
            f.crosses,
            f.needs_independent_columns,
            f.needs_all_rows,
            f.is_sparse,
        )
        for name, f in FORMULATIONS.items()
    }
    assert found == FACTS


def test_gains_in_the_right_side():
    """2 α and β² of Baumgarte; 2 μ ω and ω² of penalties."""
    alf, dual = FORMULATIONS["alf"], FORMULATIONS["alf-dual"]
    assert alf.options == {"alpha": 1e5, "epsilon": 1e-9, "iterations": 100, "omega": 10.0, "mu": 1.0}
    assert dual.options == {"alpha": 1e10, "epsilon": 1e-12, "iterations": 20, "omega": 0.0, "mu": 1.0}
    for each in (alf, dual):
        assert each.feedback and each.feedback({**each.options, "omega": 3.0, "mu": 0.5}) == (3.0, 9.0)
    baumgarte = STABILISATIONS["baumgarte"]
    assert baumgarte.options == {"alpha": 5.0, "beta": 5.0}
    assert baumgarte.feedback and baumgarte.feedback({"alpha": 3.0, "beta": 7.0}) == (6.0, 49.0)
    assert {name for name, f in FORMULATIONS.items() if f.feedback} == {"alf", "alf-dual"}
    assert {name for name, s in STABILISATIONS.items() if s.feedback} == {"baumgarte"}


def test_kernels_and_turns_of_stabilisations():
    """Steps of projection turn bodies less, since it corrects by Newton's method from their ends."""
    turns = {name: s.largest_turn for name, s in STABILISATIONS.items()}
    assert turns == {"none": 1.0, "baumgarte": 1.0, "partitioning": 1.0, "projection": 0.75}
    modules = {
        "none": all_coordinates,
        "baumgarte": all_coordinates,
        "partitioning": partitioning,
        "projection": projection,
    }
    for name, module in modules.items():
        chart = STABILISATIONS[name]
        for part in ("enter", "accept", "rates"):
            kernel = getattr(chart, part)
            assert kernel.function.__name__ == part, (name, part)
            assert kernel is getattr(module, part, kernel), (name, part)
        assert (chart.memory is None) is (module is all_coordinates)
    for name in ("none", "baumgarte", "partitioning"):
        assert STABILISATIONS[name].rates_with_outputs is STABILISATIONS[name].rates
    assert STABILISATIONS["partitioning"].options == {"kept": 0.6}


def test_orders_and_options_of_integrators():
    found = {name: (i.order, i.adaptive, dict(i.options), i.crosses) for name, i in INTEGRATORS.items()}
    assert found == {
        "dop853": (8, True, {}, "no"),
        "rk4": (4, False, {"step": 1e-4}, "no"),
        "adams": (12, True, {"max_order": 12}, "no"),
        "taylor": (30, True, {"order": 0.0}, "by series"),
    }
    assert INTEGRATORS["taylor"].step is None is INTEGRATORS["taylor"].propose
    assert INTEGRATORS["rk4"].propose is INTEGRATORS["dop853"].propose is not INTEGRATORS["adams"].propose


@pytest.mark.parametrize("name", ["lm1+none/rk4", "alf-dual+projection/adams"])
def test_kernels_that_a_method_needs(name, monkeypatch):
    method = Method.parse(name)
    chart, integrator = method.stabilisation, method.integrator
    kernels = preparation.kernels_of(method)
    assert kernels[:5] == [
        integrator.step,
        integrator.propose,
        chart.rates,
        chart.accept,
        method.formulation.accelerate,
    ]
    assert kernels[5:8] == [preparation.advance_to_end, preparation.evaluate_along, preparation.displace_all]
    assert kernels[8] is chart.enter.callable and len(kernels) == 9
    of_taylor = [preparation.evaluate_along, preparation.displace_all]
    assert preparation.kernels_of(Method.parse("taylor")) == of_taylor
    prepared: list[Any] = []
    monkeypatch.setattr(preparation, "prepare_all", prepared.append)
    preparation.prepare(method)
    assert prepared == [kernels]


def test_kernels_of_the_series_in_both_orders(monkeypatch):
    """The kernels that Python calls stand in the middle, since both processes need their helpers."""
    prepared: list[Any] = []
    monkeypatch.setattr(of_series, "prepare_all", prepared.append)
    of_series.prepare_series()
    of_series.prepare_series_backwards()
    one, other = prepared
    assert one == of_series.KERNELS_OF_SERIES and other == one[::-1]
    half = len(of_series.CALLED) // 2
    assert one[:half] == of_series.CALLED[:half] and one[half : half + 9] == of_series.FROM_PYTHON


@pytest.mark.parametrize("series", [True, False])
def test_a_run_begins_with_its_stepper(monkeypatch, series):
    """1 s until the run is made, of which 0.25 s were spent on generated code."""
    prepared: list[int] = []
    clock = iter([10.0, 11.0])
    monkeypatch.setattr(starting, "time", SimpleNamespace(process_time=lambda: next(clock)))
    monkeypatch.setattr(starting, "prepare_series", lambda: prepared.append(1))
    monkeypatch.setattr(starting, "Run", lambda *given: SimpleNamespace(given=given, making=0.25, built=0.0))
    method: Any = SimpleNamespace(is_series=series)
    run: Any = starting.start_run("scene", method, "times", "limits")  # type: ignore[arg-type]
    stepper = starting.SeriesStepper if series else starting.ExplicitStepper
    assert run.given == ("scene", method, "times", "limits", stepper)
    assert run.built == 0.75 and prepared == [1] * series


def test_numbers_in_which_scenes_of_a_structure_differ():
    """Everything but kinds, bodies and places of rows."""
    assert (POINT, DOT1, DOT2, DISTANCE, COUPLED_ANGLE, COUPLED_SLIDE) == (0, 1, 2, 3, 4, 5)
    assert (MOMENT, FORCE, SPRING, ABOUT_AXIS, ALONG_AXIS) == (0, 1, 2, 3, 4)
    named = lambda schema: schema(*schema._fields)  # noqa: E731
    data = SceneData(
        "gravity",  # type: ignore[arg-type]
        "lengths",  # type: ignore[arg-type]
        "metric_root",  # type: ignore[arg-type]
        named(Bodies),
        named(Primitives),
        "row_bodies",  # type: ignore[arg-type]
        named(Functions),
        named(Loads),
    )
    of_primitives = "point_first point_second direction_first turning_first direction_second length"
    of_functions = "amplitude frequency phase polynomial begin part cubic"
    of_loads = "force point_first point_second axis x_first y_first x_second stiffness damping natural"
    assert list(data.numbers) == [
        *["gravity", "lengths", "metric_root", "mass", "inertia"],
        *of_primitives.split(),
        *of_functions.split(),
        *of_loads.split(),
    ]
