"""Standard output that cannot be written, or that control characters or banners of engines would spoil."""

import json
import os
from contextlib import redirect_stdout, suppress

import pytest

from crosscheck.cli import main as crosscheck
from mbref.cli import main
from tests.helpers.fake_engines import FAKES
from tests.helpers.falling_engine import STONE

PROGRAMS = {"mbref": main, "crosscheck": crosscheck}
PRINTING = [
    *(("mbref", ["list"]), ("mbref", ["schema"]), ("mbref", ["diagnose", "four_bar", "--start"])),
    *(("mbref", ["completion", "bash"]), ("mbref", ["--version"]), ("mbref", ["run", "--help"])),
    ("mbref", ["run", "four_bar", "--duration", "0.01", "--samples", "3", "--estimate", "no"]),
    *(("crosscheck", ["list", "metrics"]), ("crosscheck", ["findings"]), ("crosscheck", ["--version"])),
    ("crosscheck", ["closed-loops"]),
]


@pytest.mark.parametrize(
    ("program", "words"), PRINTING, ids=lambda x: x if isinstance(x, str) else " ".join(x)
)
def test_output_to_a_full_disk_ends_with_one_sentence(program, words, capsys):
    """Linux refuses each byte that is written to /dev/full, with the error of a full disk."""
    with open("/dev/full", "w") as full, redirect_stdout(full):
        assert PROGRAMS[program](words) == 2
    assert capsys.readouterr().err == "standard output: No space left on device\n"


@pytest.mark.parametrize(("program", "command"), [("mbref", "list"), ("crosscheck", "closed-loops")])
def test_output_to_a_closed_pipe_ends_with_one_sentence(program, command, capsys):
    """The end of the pipe that `head` or a pager would read is closed before the command writes."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe, redirect_stdout(pipe):
        assert PROGRAMS[program]([command]) == 2
    assert capsys.readouterr().err == "standard output: Broken pipe\n"


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("word", ["\x1b[31mred", "a\x07b", "c\x9b2Jd", "r\rs", "\u202eback"])
def test_errors_print_no_control_character_of_a_word_of_the_command_line(program, word, tmp_path, capsys):
    """Escape, bell, an 8-bit escape, carriage return and right-to-left override would act on a terminal."""
    path = f"{tmp_path}/{word}.toml"
    for words in (["run", word], ["run", "four_bar", "--method", word], [word], ["run", path]):
        with suppress(SystemExit):
            assert PROGRAMS[program](words) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") >= 4, "a sentence for each command line"
    control = [c for c in set(said.out + said.err) - {"\n", "\t"} if not c.isprintable()]
    assert not control, ascii(control)


def test_errors_print_no_control_character_of_a_scene_file(tmp_path, capsys):
    """An escape character follows a value, or is part of a key; a message that quotes it would print it."""
    (tmp_path / "faulty.toml").write_text('name = "x" \x1b[31m\n')
    (tmp_path / "key.toml").write_text('"na\\u001bme" = "x"\n')
    for name in ("faulty", "key"):
        assert main(["diagnose", str(tmp_path / f"{name}.toml")]) == 2
        assert "\x1b" not in (said := capsys.readouterr().err) and said


def test_verdict_prints_no_control_character_of_a_header_that_is_not_read(tmp_path, capsys):
    """The table has a right column, and one whose name would make the terminal's text red."""
    STONE.save(tmp_path / "stone.toml")
    table = tmp_path / "run.csv"
    rows = "".join(f"{t:.9f},1.000000000,7\n" for t in (0.0, 0.1, 0.2))
    table.write_text(f"time,stone.position.y,\x1b[31mred\n{rows}")
    assert crosscheck(["judge", str(tmp_path / "stone.toml"), str(table)]) == 0
    said = capsys.readouterr()
    assert "not read: \\x1b[31mred" in said.out and "\x1b" not in said.out + said.err


def test_modes_reports_the_crash_of_one_engine_and_hides_the_banner_of_another(capfd):
    """The engine SEGFAULT ends its process by SIGSEGV. CHATTER, version 1.2.3, writes the word "banner" to
    the file descriptor of standard output, and has no accelerations."""
    engines = [word for name in ("SEGFAULT", "CHATTER") for word in ("--engine", f"{FAKES}:{name}")]
    assert crosscheck(["modes", "point_pendulum", "--starts", "1", "--json", *engines]) == 0
    out, said = capfd.readouterr()
    crashed, silent = json.loads(out)["poses"][0]["results"]
    assert "SIGSEGV" in crashed["reason"] and crashed["error"] is None
    assert (silent["version"], silent["reason"]) == ("1.2.3", "reports no accelerations")
    assert "banner" not in out + said
