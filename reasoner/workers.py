"""Processes that end with the process that started them, even if that is killed, and have their own limit of CPU time.

Each process gets one end of a pipe; the other end belongs to the parent process. As soon as the other end is closed, the kernel
(Linux) kills the process with its children. After kill -9 or a crash, no code has to run for that, and any thread may have
started the process.
"""

from __future__ import annotations

import fcntl
import os
import resource
import select
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from subprocess import Popen

LAUNCHER = os.path.abspath(__file__)  # noqa: PTH100 - in a fast start
CPU_SECONDS = 3_600.0
"""Default limit of CPU seconds of a process."""
MOST_SECONDS = 1e9
TEXT_BYTES = 2_000
"""Number of characters from the end of a process's stderr that are reported."""


class WorkerError(RuntimeError):
    """A process ended without an answer.

    Parameters
    ----------
    said : str
        Its output on stderr.
    status : int
        Its exit code, negative for a signal.
    """

    def __init__(self, said: str, status: int) -> None:
        super().__init__(f"ended with {status}: {said}")
        self.said, self.status = said, status

    @property
    def late(self) -> bool:
        """Whether the process ended at its limit of CPU time."""
        return self.status == -signal.SIGXCPU

    @property
    def too_large(self) -> bool:
        """Whether the process requested more memory than its limit."""
        return self.status == -signal.SIGABRT or "memory" in self.said.lower()


def tie(end: int) -> None:
    """Have the kernel kill the process group of this process when the other end of a pipe is closed.

    Parameters
    ----------
    end : int
        The reading end, which is never read.
    """
    if sys.platform == "linux":
        fcntl.fcntl(end, fcntl.F_SETOWN, -os.getpgrp())
        fcntl.fcntl(end, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(end, fcntl.F_SETFL, fcntl.fcntl(end, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([end], [], [], 0)[0]:  # it was closed before
        os._exit(1)


def limit_cpu(seconds: float) -> None:
    """Extend the CPU limit of this process by some seconds."""
    used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    soft = int(used + min(seconds, MOST_SECONDS)) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


def start(command: Sequence[str], seconds: float = CPU_SECONDS, **options: Any) -> Popen[bytes]:
    """Start a command in a separate session; the command ends when this process ends, even if this process is killed.

    Parameters
    ----------
    command : sequence of str
    seconds : float
        Maximum CPU time of each process of the command.
    **options
        Of `subprocess.Popen`.
    """
    import weakref
    from subprocess import Popen

    ours, theirs = os.pipe()[::-1]
    try:
        limit = str(int(min(seconds, MOST_SECONDS)) + 1)
        launcher = [sys.executable, "-ISs", LAUNCHER, str(theirs), limit, *command]
        passed = (theirs, *options.pop("pass_fds", ()))
        process = Popen(launcher, pass_fds=passed, start_new_session=True, **options)
    except BaseException:
        os.close(ours)
        raise
    finally:
        os.close(theirs)
    weakref.finalize(process, os.close, ours)
    return process


def kill(process: Popen[bytes]) -> None:
    """Kill a process that was started here, with its children."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def end(process: Popen[bytes]) -> None:
    """Kill a process as `kill` does, and wait for it."""
    with suppress(OSError), process:
        kill(process)


def call(
    function: Callable[..., Any],
    *arguments: Any,
    seconds: float = CPU_SECONDS,
    megabytes: int | None = None,
    timeout: float | None = None,
    started: Callable[[Popen[bytes]], object] | None = None,
) -> Any:
    """Return the result of a function that runs in a separate process.

    Parameters
    ----------
    function : callable
        A function of a module; its output is lost.
    *arguments
        Arguments of the function; they, and the result or the exception, are pickled.
    seconds : float
        CPU time.
    megabytes : int, optional
        Memory.
    timeout : float, optional
        Seconds that may pass.
    started : callable, optional
        Called with the process, so that other code can end it by `kill`.

    Raises
    ------
    WorkerError
        The process ended before the function.
    subprocess.TimeoutExpired
        The time has passed.
    """
    import pickle
    from subprocess import PIPE

    code = (
        "import sys; sys.path[:] = sys.argv[2:]; from confab.reasoner.workers import answer; answer(int(sys.argv[1]))"
    )
    process = start(
        [sys.executable, "-c", code, str(megabytes or 0), *sys.path], seconds, stdin=PIPE, stdout=PIPE, stderr=PIPE
    )
    if started is not None:
        started(process)
    try:
        said, complaint = process.communicate(pickle.dumps((function, arguments)), timeout)
    finally:
        end(process)
    if process.returncode or not said:
        raise WorkerError(complaint.decode("utf-8", "replace")[-TEXT_BYTES:], process.returncode)
    done, result = pickle.loads(said)
    if not done:
        raise result
    return result


def answer(megabytes: int) -> None:
    """Call the function that stdin names, and write its result or exception to stdout."""
    import pickle

    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of the function
    if megabytes:
        resource.setrlimit(resource.RLIMIT_AS, (megabytes * 1_000_000,) * 2)
    function, arguments = pickle.load(sys.stdin.buffer)
    try:
        result = True, function(*arguments)
    except MemoryError:
        raise
    except Exception as error:
        result = False, error
    out.write(pickle.dumps(result))
    out.close()


def main(end: int, seconds: int, command: list[str]) -> None:
    """Become a command that ends with the process that holds the other end of a pipe."""
    tie(end)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]  # of a process that was started with a limit itself
    most = seconds + 1 if hard == resource.RLIM_INFINITY else min(seconds + 1, hard)
    resource.setrlimit(resource.RLIMIT_CPU, (min(seconds, most), most))
    os.execvp(command[0], command)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
