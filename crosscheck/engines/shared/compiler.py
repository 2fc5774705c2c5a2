"""Finds and runs the C or C++ compiler of this machine, which compiles crosscheck's functions around an
engine."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

TIME_LIMIT = 500.0  # s; half a minute is usual


class NoLibrary(Exception):
    """No library can be compiled; the message is the reason."""


@dataclass(frozen=True)
class Compiler:
    """A language, the environment variable that names its compiler, and the commands tried without it."""

    language: str
    variable: str
    commands: Sequence[str]

    def path(self) -> str:
        """Return the compiler's path; raises NoLibrary if none is installed."""
        names = (os.environ[self.variable],) if os.environ.get(self.variable) else self.commands
        found = next(filter(None, map(shutil.which, names)), None)
        if found is None:
            raise NoLibrary(f"no {self.language} compiler is installed ({', '.join(names)})")
        return found

    def run(self, command: Sequence[str]) -> None:
        """Run a command line of the compiler; raises NoLibrary with the compiler's message."""
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIME_LIMIT)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise NoLibrary(f"the {self.language} compiler could not be run: {error}") from error
        if done.returncode != 0:
            said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
            raise NoLibrary(f"the {self.language} compiler failed: {said}")


C = Compiler("C", "CC", ("cc", "gcc", "clang"))
CXX = Compiler("C++", "CXX", ("c++", "g++", "clang++"))
