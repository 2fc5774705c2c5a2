"""Text on terminals: characters that would act on a terminal are printed as escapes, such as ``\\x1b``.

Names, files and other programs' messages may contain such characters.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import Any

import rich.console
from rich.segment import Segment

from mbref.printable import printable, shortened

OUTPUT, ERRORS = "standard output", "standard error"


class Console(rich.console.Console):
    """A console of rich that prints texts by ``printable``; markup is never read from a text."""

    def __init__(self, **options: Any):
        super().__init__(**{"markup": False, "highlight": False, **options})

    def render(self, *args: Any, **options: Any) -> Iterable[Segment]:
        """Yield the segments of an object, their texts printable."""
        for segment in super().render(*args, **options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))

    def on_broken_pipe(self) -> None:
        """Raise the error of a closed pipe again, which is reported where the program ends."""
        raise  # noqa: PLE0704


@contextmanager
def printable_streams() -> Iterator[None]:
    """Print by ``printable`` on standard output and standard error during the ``with`` block; messages on
    standard error are ``shortened``.

    Consoles write to the streams themselves. An OSError of a stream has its name as ``filename``.
    """
    with (
        redirect_stdout(_Stream(sys.stdout, OUTPUT, printable)),
        redirect_stderr(_Stream(sys.stderr, ERRORS, lambda text: shortened(printable(text)))),
    ):
        yield


def discard_output() -> None:
    """Discard what is printed from now on, after an error of standard output: it would occur again when the
    interpreter ends."""
    with suppress(OSError, ValueError), open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), sys.stdout.fileno())


class _Stream:
    """A text stream that changes each text, and whose errors have its name; a closed stream discards."""

    def __init__(self, stream: Any, name: str, change: Callable[[str], str] | None = None):
        self._stream, self._name, self._change = stream or io.StringIO(), name, change
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
        if change:  # rich writes to this one: its escapes act, texts in them are printable
            self.rich_proxied_file = _Stream(stream, name)

    def write(self, text: str) -> int:
        """Write the changed text; raises OSError that names the stream."""
        with self._naming():
            self._stream.write(self._change(text) if self._change else text)
        return len(text)

    def flush(self) -> None:
        """Write what is buffered; raises OSError that names the stream."""
        with self._naming():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @contextmanager
    def _naming(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            error.filename = self._name
            raise
