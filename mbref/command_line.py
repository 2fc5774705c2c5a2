"""Programs on a command line: a parser whose messages suggest the word that was probably meant, options of
output files, and exit statuses."""

from __future__ import annotations

import _thread
import argparse
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from mbref.files import free, writable
from mbref.input_error import InputError
from mbref.scene.fields import meant
from mbref.scene.validation import SceneError
from mbref.terminal import OUTPUT, discard_output, printable_streams

CHOICE = re.compile(r"invalid choice: '?(.*?)'? \(choose from (.*)\)")
NUMBER_FAULT = re.compile(r"invalid (float|int) value: ")
BAD_INPUT, INTERRUPTED = 2, 130  # exit statuses
MOST_DURATION = 1e9  # s; a longer motion would end by the limit of time or steps in every engine
SOON = 0.01  # s after which a lost interrupt is repeated
MOST_PLACE = 1_000_000  # largest number of a singular position, an equilibrium or a vibration in a list
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
        _check_existing(getattr(found, "parser_of_command", self), found)
        return found

    def print_help(self, file: Any = None) -> None:
        """Print the help; raises OSError if it cannot be written, which argparse would hide."""
        (file or sys.stdout).write(self.format_help())

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


def status_of(action: Callable[[], int], *refused: type[Exception]) -> int:
    """Return the exit status of a program. Its faults are printed on standard error, one line for each.

    ``action`` returns the status, which is 2 if it raises InputError, SceneError, a ``refused`` exception or
    OSError, or if standard output cannot be written; 130 after an interrupt. Control characters in printed
    texts are escaped.
    """
    reported: tuple[type[Exception], ...] = (InputError, SceneError, *refused)
    with printable_streams(), _lost_interrupts_repeated():
        try:
            try:
                return action()
            finally:
                sys.stdout.flush()
        except reported as error:
            return _refuse(getattr(error, "faults", [str(error)]))
        except KeyboardInterrupt:
            return _refuse(["interrupted"], INTERRUPTED)
        except MemoryError:
            return _refuse(["the memory of this machine does not suffice"])
        except OSError as error:  # a file or standard output could not be written
            if error.filename is None:
                raise
            if error.filename == OUTPUT:
                discard_output()
            return _refuse([f"{error.filename}: {error.strerror}"])


@contextmanager
def _lost_interrupts_repeated() -> Iterator[None]:
    """Repeat an interrupt that is lost because it comes while Python removes an object; elsewhere Python
    prints a traceback and goes on."""
    before, ended = sys.unraisablehook, threading.Event()

    def repeat() -> None:
        if not ended.wait(SOON):
            _interrupt()

    def hear(lost: sys.UnraisableHookArgs) -> None:
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            before(lost)
        elif signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            _thread.start_new_thread(repeat, ())  # a Thread's start waits: the interrupt would come too soon

    sys.unraisablehook = hear
    try:
        yield
    finally:
        sys.unraisablehook = before
        ended.set()


def _interrupt() -> None:
    """Interrupt the main thread, where it is possible by a signal, which also ends a sleep."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        _thread.interrupt_main()


def _refuse(faults: Sequence[str], status: int = BAD_INPUT) -> int:
    with suppress(OSError):  # of standard error itself
        for fault in faults:
            print(fault, file=sys.stderr)
    return status


def add_output(parser: Any, option: str = "--out", **names: Any) -> None:
    """Add an option of an output file, and ``--force``: a file that exists is refused without it."""
    parser.add_argument(option, type=output_file, **names)
    add_force(parser)


def add_force(parser: Any) -> None:
    """Add the option ``--force``."""
    parser.add_argument("--force", action="store_true", help="replace a file that exists")


def _check_existing(command: argparse.ArgumentParser, found: argparse.Namespace) -> None:
    """Raise InputError for an output file that exists, unless it is to be replaced."""
    for action in command._actions:
        if action.type is output_file and (path := getattr(found, action.dest)):
            free(path, found.force)


def output_file(text: str) -> str:
    """Return the path of a file, if the file can be written: the type of an option.

    Raises ``argparse.ArgumentTypeError`` with the cause, before any work is done.
    """
    try:
        if not text or Path(text).is_dir():
            raise argparse.ArgumentTypeError(f"{text!r} is a folder; name a file")
        if not Path(text).parent.is_dir():
            raise argparse.ArgumentTypeError(f"there is no folder {Path(text).parent}")
        may_write = writable(text)
    except (OSError, ValueError) as error:  # a name that no file can have
        raise argparse.ArgumentTypeError(f"{text!r}: {getattr(error, 'strerror', error)}") from None
    if not may_write:
        raise argparse.ArgumentTypeError(f"{text} cannot be written: no permission for its folder")
    return text


def record_file(text: str) -> str:
    """Return the path of a file to which records are added: the type of an option, with the faults of
    ``output_file``. Records that the file has already remain."""
    return output_file(text)


def each_once(option: str, pairs: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """Return the names and values of an option that may be repeated; raises InputError for a name that is
    given twice, of whose values only the last one would count."""
    found: dict[Any, Any] = {}
    for name, value in pairs:
        if name in found:
            raise InputError(f"{option}: {name} is given twice; give it once")
        found[name] = value
    return found


def whole(least: int, most: int) -> Callable[[str], int]:
    """Return a parser of whole numbers from ``least`` to ``most``."""

    def number(text: str) -> int:
        # more digits than the limit has are not converted: their conversion takes long
        is_number = text.isdecimal() and len(text) <= len(str(most))
        if not (is_number and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(f"must be a whole number from {least} to {most}, got {text:.40}")
        return int(text)

    return number


def number(most: float, unit: str = "", zero: bool = False) -> Callable[[str], float]:
    """Return a parser of positive numbers up to ``most``, also of 0 if ``zero``; ``unit`` is printed."""
    ends = f"must be {'from 0 to' if zero else 'positive and at most'} {most:g}{unit and ' ' + unit}"

    def parsed(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"must be a number, got {text[:40]!r}") from None
        if not (0 < value <= most or (zero and value == 0)):
            raise argparse.ArgumentTypeError(f"{ends}, got {text:.40}")
        return value

    return parsed


def output_folder(text: str) -> str:
    """Return the path of a folder, if files can be written there: the type of an option.

    The folder and its parents may be missing. Raises ``argparse.ArgumentTypeError`` with the cause.
    """
    path = Path(text).absolute()
    try:
        there = next(place for place in (path, *path.parents) if place.exists())
    except (OSError, ValueError) as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {getattr(error, 'strerror', error)}") from None
    if not there.is_dir():
        raise argparse.ArgumentTypeError(f"{there} is a file; name a folder")
    if not os.access(there, os.W_OK):
        raise argparse.ArgumentTypeError(f"{text} cannot be written: no permission for {there}")
    return text


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
