"""A fork server: a process that has imported what every child process needs. Children are its forks.

The imports take about a second of CPU time, a fork takes milliseconds. The server is a program of its own,
because a fork of this process might lack threads that hold locks. The server of `multiprocessing` would run a
user's script again in each child, unless the script guards its calls by ``if __name__ == "__main__"``.

``python -m crosscheck.processes.fork_server`` has a socket to its parent as standard input. The parent sends
the environment of a child, whose PYTHONPATH is its module search path, and three file descriptors: standard
input and output of the child, and a pipe for its process id and its exit status.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from threading import Lock
from typing import Any, NamedTuple, cast

from crosscheck.engine import BUILT_IN, OPTIONAL, engine
from crosscheck.processes import serve

# on other systems a forked process may lack threads of the system's libraries
AVAILABLE = sys.platform == "linux"
ENDING_SECONDS = 1.0  # s in which the server, or a worker whose parent has ended, must end by itself
Environment = Mapping[str, str]


class Server(NamedTuple):
    """The process of the server, and the socket to it."""

    process: subprocess.Popen[bytes]
    requests: Connection[Any, Any]


class Forked:
    """A fork of the server, with the methods of `subprocess.Popen` that `Child` calls."""

    def __init__(self, news: Connection[Any, Any]) -> None:
        self.pid = int(news.recv())
        self._news, self._reading = news, Lock()
        self._status: int | None = None

    def poll(self) -> int | None:
        """Return the exit status, the negative number of the signal that ended the process, or None while it
        runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0)
        return self._status

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status as `poll`; raises subprocess.TimeoutExpired after ``timeout`` (s)."""
        with self._reading:
            if self._status is None:
                if not self._news.poll(timeout):
                    raise subprocess.TimeoutExpired("crosscheck.processes.serve", cast(float, timeout))
                self._status = self._received()
            return self._status

    def _received(self) -> int:
        with self._news:
            try:
                return int(self._news.recv())
            except EOFError:  # the process that waits for the fork was killed
                return -signal.SIGKILL


_asking = Lock()
_servers: list[Server] = []  # at most one
os.register_at_fork(after_in_child=_servers.clear)  # the server belongs to the process that started it


def forked(channel: int, printed: int, environment: Environment) -> Forked:
    """Return a new fork, which calls `serve.main` with the file descriptors of its input and its output.

    Raises EOFError or OSError if the server has ended.
    """
    news, theirs = Pipe(duplex=False)
    with theirs, _asking:
        requests = _running(environment).requests
        requests.send(dict(environment))
        with socket.socket(fileno=os.dup(requests.fileno())) as sending:
            socket.send_fds(sending, [b"."], [channel, printed, theirs.fileno()])
    return Forked(news)


def _running(environment: Environment) -> Server:
    """Return the server, which starts at the first call and after its end."""
    if not _servers or _servers[0].process.poll() is not None:
        _servers[:] = [_started(environment)]
    return _servers[0]


def _started(environment: Environment) -> Server:
    """Start a server. It prints nothing: if the imports fail, a child that is no fork prints the error."""
    ours, theirs = Pipe()
    command = [sys.executable, "-P", "-m", "crosscheck.processes.fork_server"]
    nothing = subprocess.DEVNULL
    with theirs:
        return Server(
            subprocess.Popen(
                command,
                stdin=theirs.fileno(),
                stdout=nothing,
                stderr=nothing,
                env=environment,
                start_new_session=True,
            ),
            ours,
        )


@atexit.register
def end() -> None:
    """End the server; the CPU time of its forks then counts as CPU time of this process's children."""
    for server in _servers:
        server.requests.close()
        try:
            server.process.wait(ENDING_SECONDS)
        except subprocess.TimeoutExpired:  # a fork of this process has the socket, too
            server.process.kill()
            server.process.wait()
    _servers.clear()


def main() -> None:
    """Fork a child for each request until the parent closes the connection."""
    for name in (*BUILT_IN, *OPTIONAL):
        engine(name)  # imports the adapter, not the engine's package
    gc.freeze()
    signal.signal(signal.SIGCHLD, _reap)
    requests: Connection[Any, Any] = Connection(os.dup(0))
    try:
        while not _is_child(requests):
            pass
    except EOFError:
        return
    serve.main()


def _reap(*_: object) -> None:
    """Remove ended processes; their CPU time then counts as the server's."""
    with contextlib.suppress(ChildProcessError):  # none is left
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _is_child(requests: Connection[Any, Any]) -> bool:
    """Wait for a request and fork; return True in the fork. Raises EOFError if the parent has ended."""
    environment = requests.recv()
    with socket.socket(fileno=os.dup(requests.fileno())) as receiving:
        _, descriptors, _, _ = socket.recv_fds(receiving, 1, 3)
    if os.fork():
        for descriptor in descriptors:
            os.close(descriptor)
        return False
    requests.close()
    _keep(*descriptors)
    os.environ.clear()
    os.environ.update(environment)
    sys.path[:] = environment["PYTHONPATH"].split(os.pathsep)
    importlib.invalidate_caches()
    return True


def _keep(channel: int, printed: int, news: int) -> None:
    """Fork once more and return in the fork; this process reports the exit status of the fork and ends."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCHLD})
    with Connection(news, readable=False) as reports:
        if worker := os.fork():
            os.close(channel)
            os.close(printed)
            status = _status(worker, news)
            with contextlib.suppress(BrokenPipeError):  # the parent has ended
                reports.send(os.waitstatus_to_exitcode(status))
            os._exit(0)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGCHLD})
        os.setsid()
        reports.send(os.getpid())
    for descriptor, replaced in ((channel, (0,)), (printed, (1, 2))):
        for number in replaced:
            os.dup2(descriptor, number)
        os.close(descriptor)


def _status(worker: int, news: int) -> int:
    """Wait for the worker, kill the processes that it leaves behind, and return its status.

    A worker whose parent has ended is killed unless it ends by itself within a second. The parent has ended
    if no process reads ``news``.
    """
    reader = select.poll()
    reader.register(news, 0)
    # the ended worker stays a zombie for now, so that no other process gets its number
    while not os.waitid(os.P_PID, worker, os.WEXITED | os.WNOHANG | os.WNOWAIT):
        has_parent = not reader.poll(0)
        signal.sigtimedwait({signal.SIGCHLD}, ENDING_SECONDS)
        if not has_parent:
            os.kill(worker, signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError):  # the worker has ended before it had a group
        os.killpg(worker, signal.SIGKILL)
    return os.waitpid(worker, 0)[1]


if __name__ == "__main__":
    main()
