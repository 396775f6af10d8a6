"""Many rollouts of a plan: in this process, in several processes, or on a Ray cluster.

The result of a rollout depends only on its trial and seed, not on the process. If a process dies, another process repeats its
rollout.
"""

from __future__ import annotations

import math
import pickle
import signal
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, Pipe, wait
from subprocess import DEVNULL, Popen
from typing import Any

from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.limits import LimitError, check, current
from confab.reasoner.symbols import PrimitiveStep, State
from confab.reasoner.workers import CPU_SECONDS, end, limit_cpu, start
from confab.sim.engine import Engine
from confab.sim.staging import Perturbation
from confab.sim.verify import Rollout, verify
from confab.sim.world import PhysicsWorld

TRIES = 3
"""Number of dead processes after which a rollout is given up."""

RAY = "ray"
"""Value of `workers`, or scheme of an address in `workers`, that selects a Ray cluster."""

Done = Callable[[Rollout], None]


@dataclass(frozen=True)
class Trial:
    """The arguments of `confab.sim.verify.verify` without the seed."""

    embodiment: Embodiment
    initial: State
    steps: Sequence[PrimitiveStep]
    expected: Sequence[State]
    perturb: Perturbation | None = None
    beads: bool = True
    noise: float = 0.0
    prepare: Callable[[PhysicsWorld], None] | None = None

    def run(
        self,
        seed: int,
        watch: Callable[[Engine], None] | None = None,
        progress: Callable[[int, PrimitiveStep], None] | None = None,
        gui: bool = False,
    ) -> Rollout:
        """Execute the rollout with a seed in this process."""
        return verify(
            self.embodiment,
            self.initial,
            self.steps,
            self.expected,
            seed=seed,
            perturb=self.perturb,
            beads=self.beads,
            noise=self.noise,
            prepare=self.prepare,
            watch=watch,
            progress=progress,
            gui=gui,
        )


def wilson(good: int, of: int, z: float = 1.96) -> tuple[float, float]:
    """Return Wilson's confidence interval (95 % by default) of a share, given `good` cases out of `of` cases.

    >>> low, high = wilson(98, 100)
    >>> print(f"{low:.3f} {high:.3f}")
    0.930 0.994
    """
    share, spread = good / of, z * z / of
    middle = (share + spread / 2) / (1 + spread)
    half = z / (1 + spread) * math.sqrt(share * (1 - share) / of + spread / (4 * of))
    return max(0.0, middle - half), min(1.0, middle + half)


def rollouts(trial: Trial, seeds: Sequence[int], workers: int | str = 1, done: Done | None = None) -> list[Rollout]:
    """Return a rollout per seed, in the order of the seeds.

    Parameters
    ----------
    trial : Trial
        The trial is pickled if there is more than one worker. If the trial is pickled, its `prepare` must be a function of a
        module, or a `functools.partial` of such a function.
    seeds : sequence of int
    workers : int or str
        Number of processes, where 1 means this process. The value ``ray`` selects the Ray cluster of this machine, which is
        started if necessary. The value ``ray://HOST:PORT`` selects the cluster at an address.
    done : callable, optional
        Function that is called with each finished rollout, in the order of completion.

    Raises
    ------
    ValueError
        `workers` is neither a positive number nor a Ray address.
    RuntimeError
        Three processes died at the same rollout, or Ray is requested but isn't installed.
    """
    finished = {}
    for rollout in _stream(trial, seeds, workers):
        finished[rollout.seed] = rollout
        if done is not None:
            done(rollout)
    return [finished[seed] for seed in seeds]


def _stream(trial: Trial, seeds: Sequence[int], workers: int | str) -> Iterator[Rollout]:
    """Yield rollouts in the order of completion from the workers that `workers` selects."""
    name = str(workers)
    if name == RAY or name.startswith(f"{RAY}://"):
        return _on_ray(trial, seeds, name)
    if not name.isdecimal() or int(name) < 1:
        raise ValueError(f"workers '{workers}': give a number of processes, 'ray' or 'ray://HOST:PORT'")
    if min(int(name), len(seeds)) == 1:
        return (trial.run(seed) for seed in seeds)
    return _Pool(trial, seeds, int(name)).stream()


# ------------------------------------------------------------------------------------------------- processes


def work(descriptor: int) -> None:
    """Receive a trial, then seeds until the connection closes; send each seed's rollout, or the exception that was raised."""
    connection = Connection(descriptor)
    trial: Trial | None = None
    with suppress(EOFError, ConnectionError):
        while True:
            message = connection.recv_bytes()
            limit_cpu(CPU_SECONDS)
            try:
                if trial is None:
                    trial = pickle.loads(message)
                    continue
                result: Rollout | Exception = trial.run(pickle.loads(message))
            except Exception as error:
                result = error
            connection.send(result)


@dataclass
class _Pool:
    """A pool of processes that run the rollouts of seeds."""

    trial: Trial
    seeds: Sequence[int]
    size: int
    waiting: deque[int] = field(init=False)
    busy: dict[Connection, tuple[Popen[bytes], int]] = field(default_factory=dict)
    started: list[Popen[bytes]] = field(default_factory=list)
    deaths: Counter[int] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.waiting = deque(self.seeds)

    def stream(self) -> Iterator[Rollout]:
        """Yield rollouts in the order of completion; end all processes at the end and after an exception."""
        try:
            for _ in range(min(self.size, len(self.seeds))):
                self._start()
            while self.busy:
                check("simulating")
                for ready in wait(list(self.busy), current().left):
                    assert isinstance(ready, Connection)
                    rollout = self._receive(ready)
                    if rollout is not None:
                        yield rollout
        finally:
            for connection in self.busy:
                connection.close()
            for process in self.started:
                end(process)

    def _start(self) -> None:
        """Start a process with the next seed."""
        here, there = Pipe()
        code = "import sys; sys.path[:] = sys.argv[2:]; from confab.sim.rollouts import work; work(int(sys.argv[1]))"
        command = [sys.executable, "-c", code, str(there.fileno()), *sys.path]
        # each rollout has a limit of its own in the process
        process = start(command, math.inf, pass_fds=(there.fileno(),), stdin=DEVNULL)
        self.started.append(process)
        there.close()
        here.send(self.trial)
        self._give(here, process)

    def _give(self, connection: Connection, process: Popen[bytes]) -> None:
        """Send the next seed to a process, or close the connection if no seed is left."""
        if not self.waiting:
            connection.close()
            return
        seed = self.waiting.popleft()
        self.busy[connection] = process, seed
        connection.send(seed)

    def _receive(self, connection: Connection) -> Rollout | None:
        """Return the rollout of a process; if the process died, start a new process with the same seed and return None."""
        process, seed = self.busy.pop(connection)
        try:
            result: Rollout | Exception = connection.recv()
        except (EOFError, OSError):
            self._replace(process, seed)
            return None
        if isinstance(result, Exception):
            connection.close()
            raise result
        self._give(connection, process)
        return result

    def _replace(self, process: Popen[bytes], seed: int) -> None:
        """Start a new process for the seed of a dead process, or raise `RuntimeError` after `TRIES` deaths."""
        status = process.wait()
        if status == -signal.SIGXCPU:
            raise LimitError(f"gave up: the rollout of seed {seed} took {CPU_SECONDS:,.0f} s of CPU time")
        self.deaths[seed] += 1
        if self.deaths[seed] >= TRIES:
            raise RuntimeError(
                f"the rollout of seed {seed} was given up: {TRIES} processes died at it (the last with {status})"
            )
        self.waiting.appendleft(seed)
        self._start()


# ------------------------------------------------------------------------------------------------- Ray


def _on_ray(trial: Trial, seeds: Sequence[int], address: str) -> Iterator[Rollout]:
    """Yield rollouts of a Ray cluster in the order of completion. Ray repeats the rollouts of workers that died."""
    try:
        import ray
    except ImportError as error:
        raise RuntimeError("workers on a Ray cluster need Ray: pip install ray") from error
    begun = not ray.is_initialized()
    if begun:
        ray.init(address=None if address == RAY else address, log_to_driver=False, logging_level="error")
    try:
        task: Any = ray.remote(num_cpus=1, max_retries=TRIES - 1)(Trial.run)
        shared = ray.put(trial)
        pending = [task.remote(shared, seed) for seed in seeds]
        while pending:
            check("simulating")
            ready, pending = ray.wait(pending, timeout=current().left)
            yield from ray.get(ready)
    finally:
        if begun:
            ray.shutdown()
