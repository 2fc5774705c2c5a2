"""Processes that each make one call after another; a killed process fails its own call only.

Each process is a ProcessPoolExecutor with one worker, because a pool of several workers fails all submitted
calls if one of its processes is killed.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import Pipe, get_context, parent_process
from multiprocessing.connection import Connection, wait
from queue import SimpleQueue
from types import TracebackType
from typing import Any


class Processes(Executor):
    """A number of processes that wait for calls, as a concurrent.futures.Executor."""

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers)
        self._end, self._open = Pipe(duplex=False)  # the processes end when the second one is closed
        self._idle: SimpleQueue[ProcessPoolExecutor] = SimpleQueue()
        for _ in range(workers):
            self._idle.put(self._process())

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """Return the future of a call; if its process is killed, its exception is BrokenExecutor."""
        return self._threads.submit(self._call, function, arguments, named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes after their calls."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        while not self._idle.empty():
            self._idle.get().shutdown(wait)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes after their calls, or at once if an exception ends the ``with`` block."""
        if kind is not None:
            self._open.close()
        self.shutdown(cancel_futures=kind is not None)

    def _call(self, function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        process = self._idle.get()
        try:
            return process.submit(function, *arguments, **named).result()
        except BrokenExecutor:
            process.shutdown(wait=False)
            process = self._process()
            raise
        finally:
            self._idle.put(process)

    def _process(self) -> ProcessPoolExecutor:
        """Return a process that makes one call after another, and that starts with its first call."""
        return ProcessPoolExecutor(1, get_context("spawn"), _begin, (self._end,))


def _begin(end: Connection[Any, Any]) -> None:
    """Leave interrupts to the parent process, and end when it has ended or closed its side of a pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, args=(end,), daemon=True).start()


def _end_with_parent(end: Connection[Any, Any]) -> None:
    parent = parent_process()
    assert parent is not None
    wait([parent.sentinel, end])
    os._exit(1)


def processes(workers: int | None = None) -> Processes:
    """Return a number of processes, by default one for each core; only their parent handles interrupts."""
    return Processes(workers or os.cpu_count() or 1)
