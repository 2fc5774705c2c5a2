"""Results of one version of an engine: JSON documents of crosscheck's commands in its environment."""

from __future__ import annotations

import json
import os
import subprocess
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from crosscheck.versions.environment import Requirement, environment

LIBRARY = "crosscheck.versions.library"
DOCUMENTED = (0, 1)  # exit statuses of commands that print their document
LINES = 3  # last lines of a command that ended otherwise, as its fault
Say = Callable[[str], None]  # takes the last line of a running command
Command = Sequence[str]  # words after `python -m`


class Measured(NamedTuple):
    """Documents of the commands in one version's environment, in their order; None for a command that ended
    without a document.

    ``facts`` are of `library.facts`, and ``faults`` have a sentence for each command without a document.
    """

    requirement: Requirement
    facts: Mapping[str, Any]
    documents: Sequence[Any]
    faults: Mapping[str, str]


def measured(wanted: Requirement, engine: str, commands: Sequence[Command], say: Say, done: Say) -> Measured:
    """Return the documents of commands in the environment of a version; raises NotInstalled.

    ``say`` receives lines of the running work, ``done`` each finished part.
    """
    say(f"{wanted}: making its environment")
    python = environment(wanted)
    done(f"{wanted}: environment")
    found, faults = list[Any](), dict[str, str]()
    for command in ([LIBRARY, engine], *commands):
        document, said = _document(python, command, lambda line: say(f"{wanted}: {line}"))
        found.append(document)
        if document is None:
            words = " ".join(command)
            faults[words] = f"`{words}` ends without a result: {said}"
        done(f"{wanted}: {' '.join(command[:2])}")
    facts, *documents = found
    return Measured(wanted, facts or {}, documents, faults)


def _document(python: Path, command: Command, say: Say) -> tuple[Any, str]:
    """Return the JSON document that a command prints; if there is none, None and the last lines on standard
    error.

    The command is a process group of its own, and ends with this process.
    """
    words = [str(python), "-m", "crosscheck.processes.program", *command]
    pipe, said = subprocess.PIPE, list[str]()
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}  # it would come first
    with subprocess.Popen(
        words, stdin=pipe, stdout=pipe, stderr=pipe, text=True, process_group=0, env=own
    ) as started:
        assert started.stdout is not None and started.stderr is not None
        reader = threading.Thread(target=_read, args=(started.stderr, said, say), daemon=True)
        reader.start()
        printed = started.stdout.read()
        reader.join()
    if started.returncode in DOCUMENTED and printed.strip():
        return json.loads(printed), ""
    return None, "; ".join(said[-LINES:]) or f"exit status {started.returncode}"


def _read(lines: Any, said: list[str], say: Say) -> None:
    for line in map(str.strip, lines):
        if line:
            said.append(line)
            say(line)
