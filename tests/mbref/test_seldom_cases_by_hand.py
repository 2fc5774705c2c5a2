"""Cases that few scenes have / velocities about one axis, hints on columns, unequal masses, waiting calls."""

from __future__ import annotations

import gc
import importlib
import io
import math
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import mbref.cli
from mbref import scene_validation
from mbref.cli import run
from mbref.crossing import Crossing
from mbref.drawing import film
from mbref.ensembles import processes
from mbref.equations import diagnosis
from mbref.equations.initial_state import given_velocities
from mbref.input_error import InputError
from mbref.linear_algebra.least_norm import null_space
from mbref.outputs import chosen
from mbref.scene import Body, Revolute, Scene
from mbref.simulation import rounded_numbers, singular_position
from mbref.taylor.crossing import departure


@pytest.mark.parametrize(
    ("spin", "local"),
    [
        ((2.0, 0.0, 0.0), (0.0, -2.0, 0.0)),
        ((0.0, 2.0, 0.0), (2.0, 0.0, 0.0)),
        ((0.0, 0.0, 2.0), (0.0, 0.0, 2.0)),
    ],
)
def test_an_angular_velocity_about_one_axis_is_turned_into_the_body_s_axes(spin, local):
    """A quarter turn about z: the body's y axis is the world's -x, and its x axis is the world's y."""
    half = math.sqrt(0.5)
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0), angular_velocity=spin)
    velocity, given = given_velocities([[body]], np.array([[0.0, 0.0, 0.0, half, 0.0, 0.0, half]]))
    assert velocity == pytest.approx(np.array([[0.0, 0.0, 0.0, *local]]), abs=1e-15)
    assert given.tolist() == [[False] * 3 + [True] * 3]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("rod.acceleration", "in this motion; it needs accelerations, which the engine does not give"),
        ("kinetic_energy", "in this motion; it needs the mass and inertia of every body"),
        ("A.displacement_rate", "in this motion; it needs a joint that slides along one axis"),
        ("C.displacement", "; did you mean 'A.displacement'"),
        ("C.moment", "in this motion; it needs the mass and inertia of every body"),
    ],
)
def test_a_column_of_a_known_owner_needs_data_and_another_owner_is_no_owner(name, says):
    columns = ["time", "rod.position.x", "A.displacement", "energy"]
    with pytest.raises(InputError) as error:
        chosen(columns, [name])
    assert str(error.value).startswith(f"no column {name!r}") and says in str(error.value)


@pytest.mark.parametrize(("wanted", "limit"), [("auto", 5.0), ("yes", math.inf)])
def test_the_time_that_an_estimate_may_take(wanted, limit):
    motion: Any = SimpleNamespace(t_end=1.0, with_error_estimate=lambda seconds, progress: seconds)
    assert run._estimated(motion, wanted) == limit and run._estimated(motion, "no") is motion


def test_singular_values_belong_to_columns_that_the_masses_scale():
    """Rows (3, 4) and (1, 3) with the second column times 2 become (3, 8) and (1, 6), and then unit rows."""
    terms = SimpleNamespace(jacobian=np.array([[3.0, 4.0], [1.0, 3.0]]))
    model = SimpleNamespace(
        m=2, terms=lambda t, q: terms, data=SimpleNamespace(metric_root=np.array([1.0, 2.0]))
    )
    asked: Any = SimpleNamespace(model=model)
    values, left = singular_position._singular_values(asked, 0.0, np.zeros(7))
    cosine = (3 * 1 + 8 * 6) / (math.hypot(3, 8) * math.hypot(1, 6))
    assert values == pytest.approx([math.sqrt(1 + cosine), math.sqrt(1 - cosine), 0.0, 0.0])
    assert np.abs(left) == pytest.approx(np.full((2, 2), math.sqrt(0.5)))


def test_calls_that_wait_are_made_before_the_end(monkeypatch):
    monkeypatch.setattr(processes, "_process", lambda: ThreadPoolExecutor(1))
    pool = processes.Processes(1)
    futures = [pool.submit(pow, 2, k) for k in range(20)]
    pool.shutdown()
    assert [future.result() for future in futures] == [2**k for k in range(20)]


@pytest.mark.parametrize(
    ("missing", "write", "says"),
    [
        ("PIL.Image", film._write_gif, "GIF needs Pillow: pip install 'mbref[video]'"),
        (
            "imageio_ffmpeg",
            film._write_mp4,
            "MP4 needs imageio-ffmpeg and Pillow: pip install 'mbref[video]'",
        ),
    ],
)
def test_films_without_their_libraries(monkeypatch, tmp_path, missing, write, says):
    monkeypatch.setitem(sys.modules, missing, None)
    nothing: Any = None
    with pytest.raises(InputError, match=f"^{re.escape(says)}; SVG needs nothing more$"):
        write(tmp_path / "film", nothing, nothing, None)


@pytest.mark.parametrize(
    ("spins", "times"),
    [
        ([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], (0.0, 10.0)),
        ([[0.0, 0.6 * math.pi, 0.8 * math.pi], [0.0, 0.0, 0.5 * math.pi]], (3.5, 4.9)),
        ([[0.25 * math.pi, 0.0, 0.0], [0.25 * math.pi, 0.0, 0.0]], (2.0, 7.6)),
        ([[0.01 * math.pi, 0.0, 0.0], [0.0, 0.0, 0.0]], (0.0, 10.0)),
    ],
)
def test_the_times_around_a_crossing_depend_on_the_fastest_body(spins, times):
    """From a quarter of its turn before 4 s to 0.45 turns after, within the run: turns of 2, 8 and 200 s."""
    asked: Any = SimpleNamespace(time=4.0, angular_velocity=np.array([spins]))
    assert Crossing.instants(asked, 10.0, 3) == pytest.approx(np.linspace(*times, 3))


@pytest.mark.parametrize("collects", [True, False])
def test_the_collector_of_garbage_is_as_it_was_after_the_imports(collects):
    before = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        importlib.reload(mbref.cli)
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()
        gc.unfreeze()


@pytest.mark.parametrize(
    ("name", "place", "found"),
    [
        ("rod", 1, "rod"),
        ("r" * 79, 1, "r" * 79),
        ("r" * 80, 1, ""),
        ("other", 1, ""),
        ("7", 1, ""),
        ("a[1", 1, ""),
        ("a]", 1, ""),
        ("", 1, ""),
        ("rod", 2, ""),
    ],
)
def test_the_name_of_an_entry_that_a_path_may_contain(name, place, found):
    """The first entry has the name ``other``, so that a second one is no name."""
    data = {"body": [{"name": "other"}, {"name": name}]}
    assert scene_validation._own_name(data, "body", place) == found


@pytest.mark.parametrize(("rows", "is_decomposed"), [(5, True), (4, False)])
def test_reactions_are_decomposed_up_to_a_number_of_rows(monkeypatch, rows, is_decomposed):
    """A revolute joint has five rows."""
    monkeypatch.setattr(diagnosis, "MOST_DIAGNOSED_ROWS", rows)
    bar = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))
    joint = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    found = mbref.diagnose(Scene(name="s", body=(bar,), joint=(joint,), duration=1.0))
    assert (found.determined_reactions is not None) == is_decomposed and found.counts.rows == 5


def test_joints_of_lost_rows_take_part_by_a_part_of_the_largest(monkeypatch):
    """The second column of left singular vectors belongs to a value that exists at other poses only."""
    left = np.array([[0.6, 0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 1e-12, 1.0]])
    values = np.array([1.0, 1e-12, 1e-12, 0.0, 0.0])
    monkeypatch.setattr(singular_position, "_singular_values", lambda *_: (values, left))
    asked: Any = SimpleNamespace(model=SimpleNamespace(row_joint=("A", "B", "C")))
    assert singular_position._joints(asked, 0.0, np.zeros(7), 2) == ("A", "B")


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_ranks_do_not_depend_on_the_unit(size):
    assert null_space(size * np.array([[1.0, 0.0], [0.0, 1e-7]]), 1e-6).shape == (2, 1)
    assert null_space(size * np.array([[1.0, 0.0], [0.0, 1e-5]]), 1e-6).shape == (2, 0)


def test_pictures_of_a_film_have_their_own_size(monkeypatch):
    asked: list[Any] = []
    image = io.BytesIO()
    Image.new("RGBA", (3, 2), (255, 0, 0, 255)).save(image, "PNG")
    monkeypatch.setattr(film, "frames", lambda scene, motion, view: [(scene, motion, view)])
    monkeypatch.setattr(film, "png", lambda *given: asked.append(given) or image.getvalue())
    given: Any = ("scene", "motion", "view")
    [found] = film._images(*given)
    assert asked == [(given, 1)] and found.size == (3, 2) and found.getpixel((0, 0)) == (255, 0, 0)


@pytest.mark.parametrize(
    ("moved", "changed", "there", "misses"),
    [
        (0.0, 1.0, 0.0, False),
        (0.0, 1.01, 0.0, True),
        (0.0, 2.0, 4.0, False),
        (0.25, 0.0, 0.0, False),
        (0.26, 0.0, 0.0, True),
    ],
)
def test_a_series_misses_its_start_by_a_part_of_the_larger_speed(monkeypatch, moved, changed, there, misses):
    """Half of a speed of 2 m/s before, or of another one at the series' beginning; 0.25 m of the way."""
    monkeypatch.setattr(departure, "START_ERROR", 0.5)
    q, v = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    states = {
        -0.5: (
            q + np.array([0.0, 0.0, moved, 0.0, 0.0, 0.0, 0.0]),
            v + np.array([0.0, 0.0, changed, 0, 0, 0]),
        ),
        0.0: (q, np.array([there, 0.0, 0.0, 0.0, 0.0, 0.0])),
    }
    options = SimpleNamespace(start_distance=0.25)
    asked: Any = SimpleNamespace(_state_at=states.__getitem__, _taylor=SimpleNamespace(options=options))
    assert departure.Departure._misses(asked, q, v, 0.5) is misses


def test_newton_s_method_beside_a_closed_pose_has_twelve_iterations(monkeypatch):
    """Two equal rows of one coordinate have the rank 1; the residual is asked once more at the end."""
    asked: list[float] = []

    def terms(t: float, q: np.ndarray, v: np.ndarray) -> Any:
        asked.append(float(q[0]))
        return SimpleNamespace(jacobian=np.array([[1.0, 0.0], [1.0, 0.0]]), phi=np.full(2, q[0] / 2))

    monkeypatch.setattr(rounded_numbers, "scaled_jacobian", lambda *_: np.array([[1.0, 0.0], [1.0, 0.0]]))
    monkeypatch.setattr(rounded_numbers, "null_space", lambda *_: np.array([[1.0], [0.5]]))
    monkeypatch.setattr(rounded_numbers, "displaced", lambda q, change: q + change)
    run: Any = SimpleNamespace(
        model=SimpleNamespace(m=2, n=2, terms=terms), start=SimpleNamespace(q=np.zeros(2))
    )
    gap = rounded_numbers.gap_of(run)
    assert asked == pytest.approx([0.1 / 2**k for k in range(13)]) and gap == pytest.approx(0.05 / 2**12)
