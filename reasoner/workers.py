"""Child processes with a limit of CPU time; they end with their parent process, even if the parent process is killed.

Each process has one end of a pipe; the other end belongs to the parent process. When the parent process's end of the pipe is
closed, the Linux kernel kills the process and its children. The parent process needn't run any code to kill its children; they
end even after ``kill -9`` or a crash of the parent.
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
"""Maximum number of characters of a process's error output that are reported."""


class WorkerError(RuntimeError):
    """Raised if a process ended without a result.

    Parameters
    ----------
    said : str
        Error output of the process.
    status : int
        Exit status, negative for a signal.
    """

    def __init__(self, said: str, status: int) -> None:
        super().__init__(f"ended with {status}: {said}")
        self.said, self.status = said, status

    @property
    def late(self) -> bool:
        """Whether the process reached its limit of CPU time."""
        return self.status == -signal.SIGXCPU

    @property
    def too_large(self) -> bool:
        """Whether the process requested more memory than its limit."""
        return self.status == -signal.SIGABRT or "memory" in self.said.lower()


def tie(end: int) -> None:
    """Let the kernel kill the process group of this process when the other end of a pipe has been closed.

    Parameters
    ----------
    end : int
        File descriptor of the pipe's reading end; nothing is read from it.
    """
    if sys.platform == "linux":
        fcntl.fcntl(end, fcntl.F_SETOWN, -os.getpgrp())
        fcntl.fcntl(end, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(end, fcntl.F_SETFL, fcntl.fcntl(end, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([end], [], [], 0)[0]:  # the other end is already closed
        os._exit(1)


def in_force(what: int, value: int) -> int:
    """Return the limit of a resource that a child process can have: `value`, or the hard limit of this process if it is lower."""
    hard = resource.getrlimit(what)[1]
    return value if hard == resource.RLIM_INFINITY else min(value, hard)


def limit_cpu(seconds: float) -> None:
    """Set the limit of CPU time of this process to `seconds` from now."""
    used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    soft = in_force(resource.RLIMIT_CPU, int(used + min(seconds, MOST_SECONDS)) + 1)
    resource.setrlimit(resource.RLIMIT_CPU, (soft, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def start(command: Sequence[str], seconds: float = CPU_SECONDS, **options: Any) -> Popen[bytes]:
    """Start a command in a separate session; the command ends when this process ends, even if this process is killed.

    Parameters
    ----------
    command : sequence of str
    seconds : float
        Maximum CPU seconds of each process of the command.
    **options
        Options of `subprocess.Popen`.
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
    """Kill a process that `start` started, and its children."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def end(process: Popen[bytes]) -> None:
    """Kill a process with its children, and wait for its end."""
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
    """Run a function in a separate process, and return its result.

    Parameters
    ----------
    function : callable
        A function of a module; its output is discarded.
    *arguments
        The arguments of the function. Arguments and result are pickled.
    seconds : float
        Maximum CPU seconds.
    megabytes : int, optional
        Maximum memory in megabytes.
    timeout : float, optional
        Maximum elapsed seconds.
    started : callable, optional
        Function that is called with the process, so that other code can end the process by `kill`.

    Raises
    ------
    WorkerError
        The process ended without a result.
    subprocess.TimeoutExpired
        The timeout has passed.
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
    """Call the function that is read from standard input, and write its result or exception to standard output."""
    import pickle

    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the output of the function becomes error output
    if megabytes:
        resource.setrlimit(resource.RLIMIT_AS, (in_force(resource.RLIMIT_AS, megabytes * 1_000_000),) * 2)
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
    """Replace this process by a command that ends when the other end of a pipe is closed."""
    tie(end)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    most = in_force(resource.RLIMIT_CPU, seconds + 1)
    resource.setrlimit(resource.RLIMIT_CPU, (max(most - 1, 1), most))  # the signal at the lower limit tells the cause
    os.execvp(command[0], command)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
