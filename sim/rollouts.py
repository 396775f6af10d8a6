"""Many rollouts of a plan: one after another, in processes of this machine, or on a Ray cluster.

What a rollout does depends on its trial and seed alone, so where it runs makes no difference to it. Processes are spawned, not
forked; one that dies costs the rollout that it was at, which another process then runs again.
"""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from reasoner.embodiment.values import Embodiment
from reasoner.limits import check, current
from reasoner.symbols import State
from sim.engine import Engine
from sim.staging import Perturbation
from sim.verify import Rollout, verify
from sim.world import Step, World

TRIES = 3
"""So many processes may die at a rollout before it is given up."""

RAY = "ray"
"""Workers of this name, or whose address begins with ``ray://``, are a Ray cluster's."""

Done = Callable[[Rollout], None]


@dataclass(frozen=True)
class Trial:
    """What is rolled out: the arguments of `sim.verify.verify` without the seed."""

    embodiment: Embodiment
    initial: State
    steps: Sequence[Step]
    expected: Sequence[State]
    perturb: Perturbation | None = None
    beads: bool = True
    noise: float = 0.0
    prepare: Callable[[World], None] | None = None

    def run(
        self,
        seed: int,
        watch: Callable[[Engine], None] | None = None,
        progress: Callable[[int, Step], None] | None = None,
        gui: bool = False,
    ) -> Rollout:
        """Return the rollout of a seed, carried out here and now."""
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
    """Return Wilson's confidence interval of a share, by default at 95 %.

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
        With more than one worker it is pickled, so its `prepare` must be a function or a `functools.partial` of one.
    seeds : sequence of int
    workers : int or str
        How many processes, 1 for this one; or ``ray`` for the Ray cluster that this machine belongs to (one is started if there
        is none), or a cluster's address, ``ray://HOST:PORT``.
    done : callable, optional
        Called with each rollout when it is done, in whatever order that happens.

    Raises
    ------
    ValueError
        `workers` is neither a positive number nor a Ray address.
    RuntimeError
        Three processes died at the same rollout; or Ray is asked for and isn't installed.
    """
    finished = {}
    for rollout in _stream(trial, seeds, workers):
        finished[rollout.seed] = rollout
        if done is not None:
            done(rollout)
    return [finished[seed] for seed in seeds]


def _stream(trial: Trial, seeds: Sequence[int], workers: int | str) -> Iterator[Rollout]:
    """Choose where to run, and yield rollouts as they are done."""
    name = str(workers)
    if name == RAY or name.startswith(f"{RAY}://"):
        return _on_ray(trial, seeds, name)
    if not name.isdecimal() or int(name) < 1:
        raise ValueError(f"workers '{workers}': give a number of processes, 'ray' or 'ray://HOST:PORT'")
    if min(int(name), len(seeds)) == 1:
        return (trial.run(seed) for seed in seeds)
    return _Pool(trial, seeds, int(name)).stream()


# ------------------------------------------------------------------------------------------------- processes


def _work(connection: Connection, trial: Trial) -> None:
    """Run the seeds that come through the connection, until it closes; what is raised is sent in place of a rollout."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started this process ends it
    try:
        while True:
            seed = connection.recv()
            try:
                connection.send(trial.run(seed))
            except Exception as error:
                connection.send(error)
    except (EOFError, OSError):
        return


@dataclass
class _Pool:
    """Processes at work on seeds."""

    trial: Trial
    seeds: Sequence[int]
    size: int
    waiting: deque[int] = field(init=False)
    busy: dict[Connection, tuple[BaseProcess, int]] = field(default_factory=dict)
    deaths: Counter[int] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.waiting = deque(self.seeds)

    def stream(self) -> Iterator[Rollout]:
        """Yield rollouts as they are done; end all processes in any case."""
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
            for connection, (process, _) in self.busy.items():
                connection.close()
                process.kill()

    def _start(self) -> None:
        """Start a process at the seed that waits longest."""
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there, self.trial), daemon=True)
        process.start()
        there.close()
        self._give(here, process)

    def _give(self, connection: Connection, process: BaseProcess) -> None:
        """Give a process its next seed, or let it go."""
        if not self.waiting:
            connection.close()
            return
        seed = self.waiting.popleft()
        self.busy[connection] = process, seed
        connection.send(seed)

    def _receive(self, connection: Connection) -> Rollout | None:
        """Return what a process has done; None if it died, and another one begins where it left off."""
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

    def _replace(self, process: BaseProcess, seed: int) -> None:
        """Start a new process for the seed at which one died."""
        process.join()
        self.deaths[seed] += 1
        if self.deaths[seed] >= TRIES:
            raise RuntimeError(
                f"the rollout of seed {seed} was given up: {TRIES} processes died at it (the last with {process.exitcode})"
            )
        self.waiting.appendleft(seed)
        self._start()


# ------------------------------------------------------------------------------------------------- Ray


def _on_ray(trial: Trial, seeds: Sequence[int], address: str) -> Iterator[Rollout]:
    """Yield rollouts as a Ray cluster has done them; one whose worker died is run again by Ray."""
    try:
        import ray
    except ImportError as error:
        raise RuntimeError("workers on a Ray cluster need Ray: pip install 'confab-planner[cluster]'") from error
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
