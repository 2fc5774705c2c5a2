"""Python code of settings, from an object that records the assignments that a function makes to it."""

from __future__ import annotations

from typing import Any


class Written:
    """A name in generated code. Its attributes are names, too, and every assignment to an attribute becomes a
    statement.

    A function that sets an engine's options writes its own code if it receives this object in place of the
    options.
    """

    _name: str
    _statements: list[str]

    def __init__(self, name: str, statements: list[str]):
        object.__setattr__(self, "_name", name)
        object.__setattr__(self, "_statements", statements)

    def __getattr__(self, name: str) -> Written:
        if name.startswith("__"):
            raise AttributeError(name)
        return Written(f"{self._name}.{name}", self._statements)

    def __setattr__(self, name: str, value: Any) -> None:
        self._statements.append(f"{self._name}.{name} = {value!r}")

    def __repr__(self) -> str:
        return str(self._name)
