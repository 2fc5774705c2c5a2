"""Output of the commands / tables, warnings and progress, character by character."""

from __future__ import annotations

import io
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table

from mbref.cli import output
from mbref.scene import Body, Scene


def printed(table: Table, width: int = 80) -> list[str]:
    """The lines of a table on a page of a width, without blanks at their ends."""
    text = io.StringIO()
    Console(file=text, width=width, markup=False, highlight=False).print(table)
    return [line.rstrip() for line in text.getvalue().splitlines()]


def test_the_table_of_two_bodies():
    """A body's name stands in its first row only, and a line follows its last row."""

    def cells(b: int, field: str) -> list[str]:
        return [f"{b}{field[0]}{axis}" for axis in "xyz"]

    table = output.body_table("state", ["rod", "wheel"], cells)
    assert printed(table) == [
        "                        state",
        "┏━━━━━━━┳━━━━━━━━━━━━━━━━━━━━━━━━━┳━━━━━┳━━━━━┳━━━━━┓",
        "┃ body  ┃                         ┃   x ┃   y ┃   z ┃",
        "┡━━━━━━━╇━━━━━━━━━━━━━━━━━━━━━━━━━╇━━━━━╇━━━━━╇━━━━━┩",
        "│ rod   │ position, m             │ 0px │ 0py │ 0pz │",
        "│       │ velocity, m/s           │ 0vx │ 0vy │ 0vz │",
        "│       │ angular velocity, rad/s │ 0ax │ 0ay │ 0az │",
        "├───────┼─────────────────────────┼─────┼─────┼─────┤",
        "│ wheel │ position, m             │ 1px │ 1py │ 1pz │",
        "│       │ velocity, m/s           │ 1vx │ 1vy │ 1vz │",
        "│       │ angular velocity, rad/s │ 1ax │ 1ay │ 1az │",
        "└───────┴─────────────────────────┴─────┴─────┴─────┘",
    ]


def test_a_long_name_is_broken_and_a_number_is_not():
    """At 80 columns numbers of 11 characters leave 8 characters of a name in a line."""
    name, number = "connecting_rod", "-1.2346e-08"
    lines = printed(output.body_table("", [name], lambda b, field: [number] * 3))
    first = next(k for k, line in enumerate(lines) if name[:8] in line)
    assert [line.split("│")[1].strip() for line in lines[first : first + 2]] == [name[:8], name[8:]]
    assert sum(line.count(number) for line in lines) == 9


def test_columns_over_time_have_units_and_six_digits():
    """Rounding errors of zeros are zeros, except in columns whose numbers are of their size."""
    table = output.column_table(
        {
            "time": np.array([0.0, 0.25]),
            "rod.position.x": np.array([1.23456789, -1e-13]),
            "A.angle": np.array([1e6, 1234567.0]),
            "position_violation": np.array([2e-14, 0.0]),
            "error_estimate": np.array([3e-13, 1e-12]),
        }
    )
    header = [" ".join(column.header.split("\n")) for column in table.columns]
    assert header[:3] == ["time s", "rod.position.x m", "A.angle rad"]
    assert [list(column.cells) for column in table.columns] == [
        ["0", "0.25"],
        ["1.23457", "0"],
        ["1e+06", "1.23457e+06"],
        ["2e-14", "0"],
        ["3e-13", "1e-12"],
    ]
    assert {column.justify for column in table.columns} == {"right"}
    assert {column.overflow for column in table.columns} == {"fold"}


@pytest.mark.parametrize(("is_terminal", "width"), [(False, 80), (True, 133)])
def test_the_width_of_the_output(monkeypatch, is_terminal, width):
    monkeypatch.setenv("COLUMNS", "133")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_terminal)
    assert output.console().width == width


def test_names_are_never_markup(capsys):
    output.console().print("[bold]rod[/bold] 12")
    assert capsys.readouterr().out == "[bold]rod[/bold] 12\n"


def test_each_warning_is_a_line(monkeypatch, capsys):
    monkeypatch.setattr(output, "probable_slips", lambda scene: [f"{scene.name} is heavy", "so is b"])
    ball = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    output.warn(Scene(name="s", body=(ball,)))
    assert capsys.readouterr() == ("", "warning: s is heavy\nwarning: so is b\n")


def test_all_outcomes_that_end_early_are_printed(capsys):
    runs = [
        SimpleNamespace(outcome=SimpleNamespace(name=name), message=f"{name} it is")
        for name in ("COMPLETED", "UNDECIDED", "COMPLETED", "NOT_FINITE")
    ]
    assert output.exit_status(*runs) == 1
    assert capsys.readouterr().out == "UNDECIDED: UNDECIDED it is\nNOT_FINITE: NOT_FINITE it is\n"
    assert output.exit_status() == 0


def test_progress_in_a_pipe(monkeypatch, capsys):
    """A line after 12 s: 3 of 8 s are simulated, and 5 s need 20 s more."""
    now = iter([100.0, 112.0])
    monkeypatch.setattr(output, "time", SimpleNamespace(monotonic=lambda: next(now)))
    with output.progress_bar("simulating", 8.0) as progress:
        progress(3.0)
    assert capsys.readouterr() == ("", "simulating: 38 %, about 20 s left\n")


def test_progress_on_a_terminal(monkeypatch):
    screen = io.StringIO()
    terminal = Console(file=screen, force_terminal=True, width=60)
    monkeypatch.setattr(output, "Console", lambda stderr: terminal if stderr else None)
    with output.progress_bar("simulating", 8.0) as progress:
        progress(2.0)
        bar = progress.__closure__[0].cell_contents
        [task] = bar.tasks
        assert (task.description, task.completed, task.total, task.percentage) == ("simulating", 2.0, 8.0, 25)
    assert bar.live.transient, "the bar does not stay"


@pytest.mark.parametrize(
    ("passed", "said"), [(1199.9, "about 3600 s left"), (1200.0, "more than an hour left")]
)
def test_more_than_an_hour(passed, said, capsys):
    """A quarter is done: three times as long is left."""
    clock = iter([0.0, passed])
    output.Lines("running", 4.0, lambda: next(clock))(1.0)
    assert capsys.readouterr().err == f"running: 25 %, {said}\n"
