"""Random command lines of every command, generated from the parsers; their options take broken inputs. Each
case runs in an empty folder. It checks the exit status, that no traceback and no character that acts on a
terminal is printed, and that no file is written elsewhere than the command line says."""

import argparse
import contextlib
import functools
import importlib
import io
import json
import os
import random
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from mbref.command_line import output_file, output_folder, record_file
from mbref.printable import ACTING
from mbref.scenes import SCENES
from tests.fuzz import mutations
from tests.fuzz.broken_files import write_file, write_folder

DOCUMENTED = (0, 1, 2, 130)  # exit statuses
LEFT_OUT = {"--run", "--recheck", "--install"}  # options that measure for minutes, or change packages
RARE = {"--page"}  # options that start a program of seconds; one in ten is used
PLAUSIBLE = 2  # first numbers or words of a list, which a user may well give
BY_ITSELF = dict.fromkeys(("draw", "animate", "plot", "modes"), "svg") | {"import": "toml"}  # outputs
NUMBERS = (
    *("1", "0.01", "0", "2", "3", "-1", "1e-9", "1e-300", "1e30", "1e308", "inf", "nan", "9" * 20),
    *("9" * 5000, "-0", "1_0", "٣", "0x10", "", "x", "1e", "--"),
)
ROBOTS = (".xml", ".urdf", ".sdf")
INPUTS: dict[str, tuple[str, ...]] = {  # options and arguments of files → suffixes; without one, any
    **dict.fromkeys(("scene", "old", "new", "render", "records", "baseline", "limits"), ()),
    **{"file": ROBOTS, "robot": ROBOTS, "table": (".csv",)},
}
HOSTILE = (
    *("../../up", "/no/such/folder", "a/b", "$(touch pwned)", "`id`", "two words", "\x1b[31m", "\x9b2J"),
    *("<b>", "%s", "{0}", "$x_1$", "-", "--", "x" * 300, "ü", "\u202e", "[red]", "a\nb", "=", ":", ",", ".."),
)
PLAIN = [word for word in HOSTILE if not {"/", "."} & set(word)]  # none leads to another folder
WORDS = {  # values of an option or argument, by its name
    "method": (*mutations.METHODS, "lm2+none/rk4[step=1e-3]", "lm1+baumgarte[alpha=nan]/rk4", "x/y"),
    "setting": ("taylor", "defaults", "tuned", "stiff"),
    "family": ("taylor", "defaults"),
    "engine": ("mbref", "mujoco", "all", "os:path", "a:b", ":"),
    "beside": ("mbref", "mbref=taylor"),
    "vary": ("gravity[1]=0:1", "body[0].mass=1+-0.1", "body[9].mass=1:2", "gravity[1]=1:0", "a=nan:inf"),
    "times": ("0,0.001", "0.001", "0,0", "1,0", "-1", "nan", "0,1e300", ",", "1e-300,2e-300"),
    "columns": ("energy", "crank.position", "A.angle", "driver(A).torque", "x", "load(0).power", "time"),
    "over": ("A.angle", "time", "x"),
    "undriven": ("A", "B", "x"),
    "units": ("mm,deg", "N mm", "furlong"),
    "column": ("time=1", "crank.position.x=2", "crank.position.x=2:mm", "a=b=c", "time=99", "time=0"),
    "unit": ("mm", "deg", "rpm", "furlong", "m"),
    "view": ("xy", "oblique", "10,20", "nan,1", "1e300,0", "1", "a,b"),
    "branch": ("1=2", "2=2", "0=0", "1=99999999999999999999", "a=b", "1"),
    "length": ("A-B=0.2", "A-B", "=1", "A-Z=1", "A-B=nan", "A-B=1e-300"),
    "closure": ("1mm", "0.5 in", "1 furlong", "-1mm", "nan m", "1e400 m"),
    "option": ("rtol=1e-6", "x=1", "=", "rtol=[[[", "rtol=null", "step=NaN", "rtol=" + "[" * 5000),
    "name": ("drake_crash", "x"),
    "section": ("speed", "summary", "paper", "../..", "x"),
    "shell": ("bash", "zsh", "fish"),
    "like": ("four_bar", "x", "scene.toml"),
    "pose": ("a=0.1", "j1=nan", "x", "=", "a=1e300"),
    "close": ("base=rod", "a=b", "a=b:revolute:y", "a", "=:", "a=a:ball:q"),
    "hold": ("rod", "crank", "x"),
    "without": ("armature,damping", "x", ","),
    "keyframe": ("0", "home", "9"),
}
SCENE_NAMES = (*sorted(SCENES), *(f"four_bar_chain[{n}]" for n in ("3", "0", "9" * 20)), "x", "")


class Command(NamedTuple):
    """A command: the program that runs it, the words before its options, and its options."""

    name: str
    program: Callable[[Sequence[str]], int]
    words: Sequence[str]
    actions: Sequence[argparse.Action]


@functools.cache
def commands() -> tuple[Command, ...]:
    """Return all commands of the programs; the program `reports` carries out `crosscheck report`."""
    for package in ("matplotlib.figure", "pinocchio"):  # an import that is interrupted cannot be repeated
        with contextlib.suppress(ImportError):
            importlib.import_module(package)

    from crosscheck.cli import main as crosscheck_main
    from crosscheck.cli.parser import parser as crosscheck_parser
    from mbref.cli import main as mbref_main
    from mbref.cli.commands import parser as mbref_parser
    from reports.__main__ import main as report_main

    found = []
    for program, whole in ((mbref_main, mbref_parser()), (crosscheck_main, crosscheck_parser())):
        for action in whole._actions:
            if isinstance(action, argparse._SubParsersAction):
                for name, command in action.choices.items():
                    found.append(Command(name, program, [name], command._actions))
    children = {"report", "paper"}  # they run the program `reports` as a child
    others = [command for command in found if command.name not in children]
    (report,) = (command for command in found if command.name == "report")
    return *others, report._replace(program=report_main, words=[])


def drawn_command(draw: random.Random) -> Command:
    """Return a command, drawn by its number of options."""
    return draw.choices(commands(), [len(command.actions) for command in commands()])[0]


def command_line(seed: int) -> str:
    """Run one command line; return its command and how it ended."""
    draw = random.Random(seed)
    chosen = drawn_command(draw)
    place = Path(tempfile.mkdtemp(prefix="case", dir="."))
    outside, before = _entries(Path()), Path.cwd()
    os.chdir(place)
    try:
        words = _words(draw, chosen)
        inside = _entries(Path())
        status, out, said = _ended(chosen, words)
        new = _entries(Path()) - inside
    finally:
        os.chdir(before)
    shown = ascii([chosen.name, *words])
    assert status in DOCUMENTED, f"exit status {status}: {shown}"
    assert "Traceback" not in said, f"{said[-200:]}: {shown}"
    assert status != 2 or said.strip(), f"bad input, and no message: {shown}"
    assert not (found := ACTING.search(out + said)), f"{found} is printed: {shown}"
    assert new <= _allowed(chosen, words), f"{new} written: {shown}"
    beyond = _entries(Path()) - outside
    assert not beyond or ".." in words, f"{beyond} written outside: {shown}"  # ..: the folder that was given
    if "--json" in words and status in (0, 1) and not {"-h", "--help"} & set(words):
        json.loads(out, parse_constant=refuse_constant)
    return f"{chosen.name} {status}"


def _entries(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def _allowed(chosen: Command, words: Sequence[str]) -> set[str]:
    """Return what a command line may write: the files that it names and its default output."""
    named = {Path(word).parts[0] for word in words if word and Path(word).parts}
    suffix = BY_ITSELF.get(chosen.name)
    default = {entry for entry in _entries_of_default(words, suffix)} if suffix else set()
    return named | default | ({"report"} if chosen.name == "report" else set())


def _entries_of_default(words: Sequence[str], suffix: str) -> Iterator[str]:
    for word in words:
        stem = Path(word).name.removesuffix(".toml")
        yield from (f"{stem}{ending}.{suffix}" for ending in ("", "-moving", "-branches", "-plot", "-mode"))
        yield f"{Path(word).stem}.{suffix}"


def _ended(chosen: Command, words: Sequence[str]) -> tuple[Any, str, str]:
    """Return exit status, standard output and standard error of a command line."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), _standard_error() as err:
        try:
            status: Any = chosen.program([*chosen.words, *words])
        except SystemExit as end:
            status = end.code
        err.flush()
        err.seek(0)
        return status, out.getvalue(), err.read()


def _words(draw: random.Random, chosen: Command) -> list[str]:
    """Return the options and arguments of a command line, and write the files that it names."""
    words: list[str] = []
    odd = draw.choice((0.0, 0.1, 0.5))  # share of strange values
    options = [action for action in chosen.actions if action.option_strings]
    usual = [action for action in options if draw.random() < (0.9 if action.required else 0.15)]
    for action in (*usual, *(action for action in chosen.actions if not action.option_strings)):
        flags = set(action.option_strings)
        if LEFT_OUT & flags or (RARE & flags and draw.random() < 0.9):
            continue
        flag = [draw.choice(action.option_strings)] if action.option_strings else []
        words += [*flag, *_values(draw, chosen, action, odd)]
    short = {"--duration": "0.001", "--samples": "3", "--starts": "1", "--reference-time": "0.1"}
    there = {option for action in options for option in action.option_strings}
    for option, value in short.items():
        if option in there and option not in words and not (option == "--samples" and "--times" in words):
            words = [option, value, *words]
    if draw.random() < 0.2 * odd and words:
        words[draw.randrange(len(words))] = draw.choice(PLAIN)
    return [word.replace("\x00", "") for word in words]


def _values(draw: random.Random, chosen: Command, action: argparse.Action, odd: float) -> list[str]:
    """Return the words of one option or argument."""
    if action.nargs == 0:
        return []
    counts = {"*": (0, 1, 1, 2), "+": (1, 1, 1, 2), "?": (0, 1)}
    count = draw.choice(counts.get(str(action.nargs), (1,)))
    return [_value(draw, chosen, action, draw.random() < odd) for _ in range(count)]


def _value(draw: random.Random, chosen: Command, action: argparse.Action, strange: bool) -> str:
    kind, hostile = action.type, strange and draw.random() < 0.15
    if action.choices and not hostile:
        return str(draw.choice(sorted(action.choices)))
    if kind in (output_file, record_file, output_folder):
        return _output(draw, chosen, strange)
    if action.dest in INPUTS:
        return _input(draw, action.dest, strange)
    known = WORDS.get(action.dest, NUMBERS if kind is not None else HOSTILE)
    return draw.choice(HOSTILE if hostile else known if strange else known[:PLAUSIBLE])


def _output(draw: random.Random, chosen: Command, strange: bool) -> str:
    suffix = draw.choice(("toml", "csv", "svg", "json", "png", "xml", "jsonl", "gif", "md", ""))
    Path("kept.csv").write_text("my own\n")
    Path("full").mkdir(exist_ok=True)
    Path("full/mine.txt").write_text("my own\n")
    odd = ("kept.csv", "full", "no/such/x.svg", "/dev/full", "/dev/null", "", "x" * 300, "..", "$(id).svg")
    return draw.choice(odd) if strange else f"new.{suffix}".rstrip(".")


def _input(draw: random.Random, what: str, strange: bool) -> str:
    """Write a file or folder that is broken, or not, and return its path; or return a name."""
    if what == "scene" and draw.random() < 0.4:
        return draw.choice(SCENE_NAMES)
    if what == "scene" and draw.random() < 0.9:
        Path("scene.toml").write_bytes(mutations.mutated_text(draw))
        return "scene.toml"
    if strange and draw.random() < 0.1:
        return draw.choice((*HOSTILE, "no_such.toml", ".", "/dev/null"))
    if what in ("old", "new", "render") or (what == "records" and draw.random() < 0.3):
        return write_folder(draw)
    return write_file(draw, INPUTS[what])


@contextlib.contextmanager
def _standard_error() -> Iterator[TextIO]:
    """Yield a file of the text that this process, and its children, write on standard error."""
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="backslashreplace") as file:
        kept = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            with contextlib.redirect_stderr(file):
                yield file
        finally:
            os.dup2(kept, 2)
            os.close(kept)


def refuse_constant(name: str) -> float:
    """Raise AssertionError, for a number that JSON does not have."""
    raise AssertionError(f"{name} is no JSON")
