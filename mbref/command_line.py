"""The parser of command lines: its messages are sentences that suggest the word that was probably meant."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from mbref.scene_fields import meant

CHOICE = re.compile(r"invalid choice: '?(.*?)'? \(choose from (.*)\)")
NUMBER_FAULT = re.compile(r"invalid (float|int) value: ")
KINDS = {"float": "must be a number, got ", "int": "must be a whole number, got "}


class Parser(argparse.ArgumentParser):
    """A parser whose commands report their own unknown options; line breaks of its texts are kept."""

    def __init__(self, *args: Any, **names: Any):
        super().__init__(*args, **names)
        self.formatter_class = argparse.RawDescriptionHelpFormatter

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options; the command refuses an unknown option and names the option that was probably
        meant."""
        found, unknown = self.parse_known_args(args, namespace)
        if unknown:
            command = getattr(found, "parser_of_command", self)
            known = [option for action in command._actions for option in action.option_strings]
            command.error(
                f"unknown option {unknown[0]!r}{meant(unknown[0], known)}"
                if unknown[0].startswith("-")
                else f"unknown argument {unknown[0]!r}{_repeated(command, args or sys.argv[1:], unknown[0])}"
            )
        return found

    def error(self, message: str) -> NoReturn:
        """Print the usage and the message, or all commands if the command line names none, and exit with
        status 2."""
        if message.endswith("required: COMMAND"):
            self.print_help(sys.stderr)
            self.exit(2)
        super().error(NUMBER_FAULT.sub(lambda kind: KINDS[kind[1]], CHOICE.sub(_known, message)))


def commands(parser: argparse.ArgumentParser, **names: Any) -> Any:
    """Return the object to which commands are added; each command's parser is in its options as
    ``parser_of_command``."""
    return parser.add_subparsers(parser_class=_Command, **names)


class _Command(Parser):
    """The parser of one command; its options have the function that makes the command as ``action``."""

    def __init__(self, *args: Any, action: Any = None, **names: Any):
        super().__init__(*args, **names)
        self.set_defaults(parser_of_command=self, action=action)


def output_file(text: str) -> str:
    """Return the path of a file, if the file can be written: the type of an option.

    Raises ``argparse.ArgumentTypeError`` with the cause, before any work is done.
    """
    path = Path(text)
    if path.is_dir():
        raise argparse.ArgumentTypeError(f"{text} is a folder; name a file")
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(f"there is no folder {path.parent}")
    _check_permission(path if path.exists() else path.parent, text)
    return text


def output_folder(text: str) -> str:
    """Return the path of a folder, if files can be written there: the type of an option.

    The folder and its parents may be missing. Raises ``argparse.ArgumentTypeError`` with the cause.
    """
    path = Path(text).absolute()
    there = next(place for place in (path, *path.parents) if place.exists())
    if not there.is_dir():
        raise argparse.ArgumentTypeError(f"{there} is a file; name a folder")
    _check_permission(there, text)
    return text


def _check_permission(place: Path, wanted: str) -> None:
    if not os.access(place, os.W_OK):
        raise argparse.ArgumentTypeError(f"{wanted} cannot be written: no permission for {place}")


def _repeated(command: argparse.ArgumentParser, words: Sequence[str], extra: str) -> str:
    """Return the advice to repeat an option if the extra word follows an option that may repeat and its
    value."""
    option = words[words.index(extra) - 2] if extra in words[2:] else ""
    repeatable = [a for a in command._actions if isinstance(a, argparse._AppendAction)]
    if not any(option in action.option_strings for action in repeatable):
        return ""
    value = words[words.index(extra) - 1]
    return f"; repeat the option for each value: {option} {value} {option} {extra}"


def _known(found: re.Match[str]) -> str:
    """Return a message such as ``unknown 'rnu'; known: run, list; did you mean 'run'?``."""
    known: Sequence[str] = re.findall(r"[^',\s]+", found[2])
    return f"unknown {found[1]!r}; known: {', '.join(known)}{meant(found[1], known)}"
