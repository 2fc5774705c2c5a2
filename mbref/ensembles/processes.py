"""Processes that each make one call after another; a killed process fails its own call only.

Each process answers through a pipe of its own. The processes of the standard library's pool answer through
one queue: where a process is killed while it writes, the pool waits for ever for the rest of the answer.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import Pipe, get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from queue import SimpleQueue
from types import TracebackType
from typing import Any


class Processes(Executor):
    """A number of processes that wait for calls, as a concurrent.futures.Executor."""

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers)
        self._end, self._open = Pipe(duplex=False)  # the processes end when the second one is closed
        self._made = [_Process(self._end) for _ in range(workers)]
        self._idle: SimpleQueue[_Process] = SimpleQueue()
        for process in self._made:
            self._idle.put(process)

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """Return the future of a call; if its process is killed, its exception is BrokenExecutor."""
        return self._threads.submit(self._call, function, arguments, named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes after their calls."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        while not self._idle.empty():
            self._idle.get().end()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes after their calls, or at once if an exception ends the ``with`` block."""
        if kind is not None:
            self._open.close()
            for process in self._made:
                process.kill()  # a process that still imports would not see the end of its pipe for seconds
        self.shutdown(cancel_futures=kind is not None)

    def _call(self, function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        process = self._idle.get()
        try:
            return process.call((function, arguments, named))
        except BrokenExecutor:
            process.end()
            process = _Process(self._end)
            self._made.append(process)
            raise
        finally:
            self._idle.put(process)


class _Process:
    """A process that makes one call after another, and that starts with its first call."""

    def __init__(self, end: Connection[Any, Any]) -> None:
        self._end = end
        self._pipe: Connection[Any, Any] | None = None
        self._process: BaseProcess | None = None

    def call(self, job: tuple[Any, ...]) -> Any:
        """Return the result of a call, or raise its exception, BrokenProcessPool if the process ends."""
        pipe = self._pipe or self._started()
        try:
            pipe.send_bytes(pickle.dumps(job))
            succeeded, value = pipe.recv()
        except (EOFError, OSError):
            raise BrokenProcessPool("the process was killed") from None
        if succeeded:
            return value
        raise value

    def _started(self) -> Connection[Any, Any]:
        context = get_context("spawn")
        pipe, of_process = context.Pipe()
        process = context.Process(target=_serve, args=(of_process, self._end), daemon=True)
        process.start()
        of_process.close()
        self._pipe, self._process = pipe, process
        return pipe

    def kill(self) -> None:
        """End the process at once, so that its call raises BrokenProcessPool."""
        if self._process:
            self._process.kill()

    def end(self) -> None:
        """End the process, which makes no call."""
        if self._pipe and self._process:
            self._pipe.close()
            self._process.join()


def _serve(pipe: Connection[Any, Any], end: Connection[Any, Any]) -> None:
    """Answer calls until the parent closes its side of the pipe; leave interrupts to the parent process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, args=(end,), daemon=True).start()
    while True:
        try:
            function, arguments, named = pipe.recv()
        except EOFError:
            return
        pipe.send_bytes(_answer(function, arguments, named))


def _answer(function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> bytes:
    """Return whether a call succeeds, and its result or exception, as bytes."""
    try:
        return pickle.dumps((True, function(*arguments, **named)))
    except Exception as fault:
        return pickle.dumps((False, fault))


def _end_with_parent(end: Connection[Any, Any]) -> None:
    parent = parent_process()
    assert parent is not None
    wait([parent.sentinel, end])
    os._exit(1)


def processes(workers: int | None = None) -> Processes:
    """Return a number of processes, by default one for each core; only their parent handles interrupts."""
    return Processes(workers or os.cpu_count() or 1)
