"""Processes that each make one call after another; a killed process fails its own call only.

A ProcessPoolExecutor would fail all submitted calls. A call and its result go through a pipe without threads,
because threads would take longer than a short run.
"""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from queue import SimpleQueue
from typing import Any


class Processes(Executor):
    """A number of processes that wait for calls, as a concurrent.futures.Executor."""

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers)
        self._idle: SimpleQueue[Worker] = SimpleQueue()
        for _ in range(workers):
            self._idle.put(Worker())

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """Return the future of a call; if its process is killed, its exception is BrokenExecutor."""
        return self._threads.submit(self._call, function, arguments, named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes after their calls."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        while not self._idle.empty():
            self._idle.get().end(wait)

    def _call(self, function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        worker = self._idle.get()
        try:
            return worker.call(function, arguments, named)
        except BrokenProcessPool:
            worker.end()
            worker = Worker()
            raise
        finally:
            self._idle.put(worker)


class Worker:
    """Process that makes one call after another. The process ends on request, or when its parent has
    ended."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_answer, args=(theirs,))
        self._process.start()
        theirs.close()

    def call(self, function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        """Return the result or raise the exception of a call made in the process; raises BrokenProcessPool if
        it is killed."""
        try:
            self._pipe.send((function, arguments, named))
            succeeded, found = self._pipe.recv()
        except (EOFError, OSError):
            raise BrokenProcessPool("the process was killed") from None
        if not succeeded:
            raise found
        return found

    def end(self, wait: bool = True) -> None:
        """Request that the process ends after its present call."""
        self._pipe.close()
        if wait:
            self._process.join()


def _answer(pipe: Connection) -> None:
    """Make the calls that arrive through a pipe, until the parent closes the pipe. The parent handles
    interrupts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(EOFError, OSError):
        while True:
            function, arguments, named = pipe.recv()
            try:
                answer = ForkingPickler.dumps((True, function(*arguments, **named)))
            except Exception as error:
                answer = _of_error(error)
            pipe.send_bytes(answer)


def _of_error(error: Exception) -> Any:
    """Return an error that can be sent to another process, by its text if it cannot be pickled."""
    try:
        return ForkingPickler.dumps((False, error))
    except Exception:
        return ForkingPickler.dumps((False, RuntimeError(repr(error))))


def processes(workers: int | None = None) -> Processes:
    """Return a number of processes, by default one for each core; only their parent handles interrupts."""
    return Processes(workers or os.cpu_count() or 1)
