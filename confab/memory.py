"""The class `Memory` for users of Python and the command line, with methods that load, learn, save, merge and show.

A memory file has two kinds of experience. Rules with counts guide the default planner (`confab.reasoner.memory.experience`). The
links between facts and quantified behaviours guide the paper's mode (`confab.reasoner.memory.links`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from confab.accepting import AnyPlan, HasPlan, named_for, plan_of
from confab.planner.paper.learning import learn as learn_plan
from confab.planner.plan import Plan, Step
from confab.reasoner.files import alone, has_content, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import MEMORY
from confab.reasoner.memory.experience import (
    ITSELF,
    Experience,
    LearnedOrder,
    LearnedRule,
    LearningError,
    Method,
    RoleFact,
    Statistics,
    Tally,
)
from confab.reasoner.memory.experience_file import MemoryLines, new_replica, parse, pull, push, turtle
from confab.reasoner.memory.links import Links
from confab.reasoner.memory.links_file import links_text, load_links, memory_lines, memory_names, refuse_another_kind
from confab.reasoner.names import Names, RightNames, right_names
from confab.table import Table

if TYPE_CHECKING:
    from rich.console import Group

    from confab.known import Known
    from confab.labels import Labels
    from confab.lifted import Sayings
    from confab.physics import Report
    from confab.planner.acting.episode import Episode
    from confab.planner.experience.advice import Advisor
    from confab.reasoner.problem import Problem


UNTAUGHT = "no step was executed as planned, and no behaviour failed"
"""Message on an episode from which nothing but durations is learned."""
MOST_LINKS = 20_000
"""Maximum number of the paper's links in a memory. If a plan would add more links, it adds no links at all, but only rules and
counts for the default planner.
"""
SHOWN = 3
"""Maximum number of preferences that are listed for a method."""


class HasSceneAndPlan(HasPlan, Protocol):
    """An object with a plan and the scene in which it was made, such as a result or an execution."""

    @property
    def scene(self) -> Known:
        """The scene."""


@right_names("a memory", "confab.Memory.of(SCENE) or confab.Memory.load(FILE)")
@dataclass
class Memory(metaclass=RightNames):
    """A confabulation memory: experience from planning and execution.

    Attributes
    ----------
    links : Links
        The paper's probabilities p(situated object instance | quantified behaviour). The probabilities are read from the file on
        first access.
    names : Names
        A mapping between short names and IRIs.
    scene : str
        IRI of the scene that the memory file imports.
    experience : Experience
        Rules, orders of goals and methods, each with the numbers of times that it was chosen, was passed over, and failed.
    trusted : set of replica
        Replicas (writers of memories) whose experience may guide the search. The replica of this memory is always trusted. If
        the memory has experience of an untrusted replica, planning uses the mode ``strict``.
    labels : function, optional
        A function that returns the labels of the scene's terms. This function is called when a text needs labels.
    """

    linked: Links | Callable[[], Links]
    names: Names
    scene: str
    experience: Experience = field(default_factory=lambda: Experience(new_replica()))
    trusted: set[str] = field(default_factory=set)
    labels: Callable[[], Labels] | None = None

    @property
    def links(self) -> Links:
        """The paper's links between facts and quantified behaviours."""
        if not isinstance(self.linked, Links):
            self.linked = self.linked()
        return self.linked

    @links.setter
    def links(self, links: Links) -> None:
        self.linked = links

    @classmethod
    def of(cls, scene: Known) -> Memory:
        """Return an empty memory for a scene."""
        return cls(Links(), scene.names, scene.iri, labels=_labels(scene))

    @classmethod
    def load(
        cls, source: str | Path, scene: Known | None = None, trust: bool = False, lines: MemoryLines | None = None
    ) -> Memory:
        """Read a memory file, or the memories at a SPARQL endpoint.

        Parameters
        ----------
        source : str or Path
            File, or URL of an endpoint.
        scene : Scene, optional
            The scene whose short names are used for the terms of the memory.
        trust : bool
            Whether the experience of every replica is trusted.
        lines : MemoryLines, optional
            The lines of the file, if the caller has read them with `confab.reasoner.memory.links_file.memory_lines`.

        Raises
        ------
        KnowledgeError
            The memory is missing, invalid, or in a newer format than this version reads. The message states the remedy.
        """
        url = endpoint(source)
        if url is not None:
            names, iri = (scene.names, scene.iri) if scene is not None else (Names(()), url)
            found = cls(Links(), names, iri, pull(url, names))
        else:
            path = Path(source)
            read = memory_lines(path) if lines is None else lines
            iri, names = (scene.iri, scene.names) if scene is not None else memory_names(path, read)
            found = cls(lambda: load_links(path, names, read), names, iri)
            lines = read
            if ":memoryFormat" in lines.rest or "core#memoryFormat" in lines.rest:
                try:
                    found.experience = parse(lines, str(path), names)
                except KnowledgeError:
                    refuse_another_kind(path)  # a scene that was saved in one file has the word in its vocabulary
                    raise
            elif not len(found.links):
                refuse_another_kind(path)
                raise KnowledgeError(f"{path}: holds no memory; without it, 'confab learn' makes a new one")
        found.labels = _labels(scene) if scene is not None else None
        found.trusted.update(found.experience.episodes if trust else found.experience.trusts)
        return found

    def learn(
        self, scene: Known | HasSceneAndPlan, plan: AnyPlan | None = None, failed: tuple[int, ...] | None = None
    ) -> None:
        """Learn from a plan that was executed from the scene's initial state.

        Parameters
        ----------
        scene : Scene, Result or Execution
            A result or an execution has its scene, so that `plan` isn't needed.
        plan : Plan, Result, Execution or file, optional
            An executed plan. For an execution, the method `live` is called.
        failed : path of a step, optional
            The failed step, or None. All earlier steps have succeeded, and no later step was executed.

        Raises
        ------
        KnowledgeError
            The plan isn't applicable in the initial state. The memory is unchanged.
        """
        from confab.planner.acting.episode import Episode
        from confab.planner.experience.lessons import live

        where, executed = _scene_and_plan(scene, plan)
        if isinstance(episode := getattr(executed, "episode", None), Episode):
            self.live(where.problem, episode)
            return
        planned = getattr(executed, "problem", where.problem)  # the plan of a result was made for the result's goal
        problem = replace(where.problem, goal=planned.goal)
        made = plan_of(executed, problem)
        try:
            links = self._linked(where, made) if failed is None else self.links
            live(self.experience, [(problem, made)], failed)
        except LearningError as error:
            raise KnowledgeError(str(error)) from error
        self.links = links

    def teach(self, scene: Known | HasSceneAndPlan, plan: AnyPlan | None = None) -> None:
        """Learn from solutions of a scene for several orders of its goals (`confab.planner.experience.lessons`).

        Parameters
        ----------
        scene : Scene or Result
            A result has its scene, so that `plan` isn't needed.
        plan : Plan, Result or file, optional
            A plan that solves the scene's task.

        Raises
        ------
        KnowledgeError
            The plan isn't applicable in the scene's initial state. The memory is unchanged.
        """
        from confab.planner.experience.lessons import teach

        where, solution = _scene_and_plan(scene, plan)
        made = plan_of(solution, where.problem)
        try:
            links = self._linked(where, made)
            teach(self.experience, where.problem, made)
        except LearningError as error:
            raise KnowledgeError(str(error)) from error
        self.links = links

    def _linked(self, scene: Known, plan: Plan) -> Links:
        """Return the paper's links after a plan was learned, or the old links if there would be more than `MOST_LINKS`."""
        learned = learn_plan(scene.problem, plan, self.links)
        return learned if len(learned) <= MOST_LINKS else self.links

    def merge(self, other: Memory | str | Path, trust: bool = False) -> None:
        """Add the counts of another memory, but not its links. With `trust`, the replicas of the other memory are trusted."""
        if not isinstance(other, Memory):
            other = Memory.load(other)
        self.experience.merge(other.experience)
        if trust:
            self.trusted.update(other.experience.episodes)

    def trust(self, replicas: Iterable[str]) -> None:
        """Let the experience of other replicas in this memory guide the search.

        Raises
        ------
        KnowledgeError
            The memory has no such replica.
        """
        for replica in replicas:
            if replica not in self.experience.episodes:
                known = ", ".join(sorted(self.experience.episodes)) or "none"
                raise KnowledgeError(f"no replica '{replica}' in this memory (there: {known})")
            self.trusted.add(replica)

    def live(self, problem: Problem, episode: Episode) -> bool:
        """Learn from an execution: from the steps that were executed as planned, and from the failed behaviours.

        Parameters
        ----------
        problem : Problem
            The problem of the episode's task.
        episode : Episode

        Returns
        -------
        bool
            Whether steps or failures were learned.
        """
        from confab.planner.acting.executed import as_planned
        from confab.planner.experience.lessons import live

        self.measure(problem, episode)
        failures = list(failed_steps(problem, episode))
        parts = list(as_planned(problem, episode))
        if parts or failures:
            live(self.experience, parts, failures=failures)
        return bool(parts or failures)

    def measure(self, problem: Problem, done: Episode | Report) -> None:
        """Learn the durations of the primitives that succeeded in an episode, or in the rollouts of a plan in physics.

        The durations in a symbolic world are assumed, and aren't learned.
        """
        from confab.planner.acting.episode import Episode
        from confab.planner.timed.measuring import measured

        if not isinstance(done, Episode):
            reports = [report for rollout in done.rollouts for report in rollout.steps]
            self.experience.measure(measured(problem, [(r.step, r.seconds) for r in reports if r.verdict.ok]))
        elif done.measured:
            events = [(event.step, event.end - event.begin) for event in done.events if event.ok]
            self.experience.measure(measured(problem, events))

    @property
    def statistics(self) -> Statistics:
        """The measured durations by behaviour and actor, of all trusted replicas; the empty actor stands for all actors."""
        return self.experience.statistics({self.experience.replica, *self.trusted})

    def durations(self, most: int | None = None) -> Table:
        """Return a table of the measured durations in seconds, for all actors and for each actor."""
        rows = [
            (behavior, actor or "all", f"{one.mean:.3f}", f"{one.spread:.3f}", f"{one.count}")
            for (behavior, actor), one in sorted(self.statistics.items())
        ]
        return Table(("behaviour", "actor", "mean", "spread", "count"), tuple(rows[:most]))

    def save(self, target: str | Path) -> Path:
        """Write the memory into a Turtle file or to a SPARQL endpoint, and return the target.

        A file is written atomically. The new file is read back before it replaces the old file. An endpoint receives only the
        counts of this memory's replica.

        Raises
        ------
        KnowledgeError
            The content of the new file differs from this memory. The old file is unchanged.
        OSError
            The file can't be written.
        """
        url = endpoint(target)
        self.experience.trusts = self.trusted - {self.experience.replica}
        if url is not None:
            push(url, self.experience, self.names, self.scene)
            return Path(target)
        links = [links_text(self.links, self.names, self.scene)] if len(self.links) else []
        lines = chain(turtle(self.experience, self.names, self.scene, words=self.sayings().said), links)
        path = named_for(MEMORY, target)
        write_whole(path, lines, check=self._check_written)
        return path

    def _check_written(self, file: Path) -> None:
        """Raise `KnowledgeError` if the content of a file differs from this memory."""
        found = memory_lines(file)
        read, links = parse(found, "the written file", self.names), load_links(file, self.names, found)
        if read != self.experience or len(links) != len(self.links):
            raise KnowledgeError(
                "the written file differs from the memory, so the old file is kept; please report this fault"
            )

    @property
    def advisor(self) -> Advisor:
        """The memory in the form that the default planner uses."""
        from confab.planner.experience.advice import Advisor

        mine = {self.experience.replica, *self.trusted}
        return Advisor(self.experience, trusted=set(self.experience.episodes) <= mine)

    def table(self, most: int | None = None) -> Table:
        """Return a table of the paper's links, the most probable links first."""
        rows = [
            (f"{behavior} {' '.join(arguments)}", str(symbol), value, f"{p:.3f}")
            for (behavior, arguments), symbols in self.links.tables.items()
            for symbol, values in symbols.items()
            for value, p in values.items()
        ]
        rows.sort(key=lambda row: (-float(row[3]), row))
        return Table(("behaviour", "symbol", "value", "p(value | behaviour)"), tuple(rows[:most]))

    def sayings(self) -> Sayings:
        """Return the writer of sentences about this memory."""
        from confab.lifted import Sayings

        return Sayings(self.labels() if self.labels is not None else None)

    def advice(self, most: int | None = None) -> Table:
        """Return a table of the learned rules with their counts, ordered by kind of goal."""
        say, totals = self.sayings(), self.experience.totals()
        rules = [one for one in self.experience.said.values() if isinstance(one, LearnedRule)]
        rows = []
        for rule in sorted(rules, key=lambda r: (r.goals.situation, r.goals.classes, r.goal.value, r.does, r.name)):
            t = totals.get(rule.name, {}).get(ITSELF, Tally())
            kind = totals.get(rule.goals.name, {}).get(ITSELF, Tally())
            record = say.said(rule.goals)
            if kind.chosen + kind.failed:
                record += f" ({kind.chosen} of {kind.chosen + kind.failed} reached by rules alone)"
            text = say.rule(rule) + ("" if rule.name not in self.experience.disabled else " – disabled")
            rows.append((record, text, f"{t.chosen}", f"{t.passed_over}", f"{t.failed}"))
        return Table(("goals", "rule", "chosen", "passed over", "failed"), tuple(rows[:most]))

    def told(self, most: int | None = None) -> list[tuple[str, list[str]]]:
        """Return, for each kind of goal, a pair of its description and its rules, as sentences with counts."""
        found: list[tuple[str, list[str]]] = []
        for row in self.advice(most):
            record, rule, chosen, passed, failed = map(str, row)
            if not found or found[-1][0] != record:
                found.append((record, []))
            counts = (("chosen", chosen), ("passed over", passed), ("failed", failed))
            said = ", ".join(f"{what} {times} time{'s' * (times != '1')}" for what, times in counts if times != "0")
            found[-1][1].append(f"{rule}.{' ' + said.capitalize() + '.' if said else ''}")
        return found

    def page(self, most: int | None = None) -> str:
        """Return a text with the rules for each kind of goal, the orders of goals, and the methods."""
        lines = [self.said()]
        for record, rules in self.told(most):
            lines += ["", f"{record}:", *(f"  – {rule}" for rule in rules)]
        others = self.also()[:most]
        lines += [*(["", "Besides:"] if others else []), *(f"  – {other}" for other in others)]
        durations = [
            f"  – {behavior} by {actor}: {mean} s ± {spread} s, {counted(int(str(count)), 'execution')}"
            for behavior, actor, mean, spread, count in self.durations(most)
        ]
        return "\n".join([*lines, *(["", "Measured durations:"] if durations else []), *durations])

    def also(self) -> list[str]:
        """Return, as sentences with counts, the learned orders of goals and the learned methods."""
        from confab.planner.experience.evidence import DECAY
        from confab.planner.experience.following import usable

        say, totals = self.sayings(), self.experience.totals()
        orders = [
            f"{say.said(order)}: so in {counted(totals[order.name][ITSELF].chosen, 'case')}"
            for order in usable(self.experience)
        ]
        methods = [one for one in self.experience.said.values() if isinstance(one, Method)]
        liked = self.experience.preferences(DECAY)
        counted_ = [
            (totals.get(one.name, {}).get(ITSELF, Tally()).chosen, say.said(one), liked.get(one.name, {}))
            for one in methods
        ]
        return [
            *orders,
            *(
                f"{text}: {counted(times, 'time')}{''.join(f'; {one}' for one in preferred(say, facts))}"
                for times, text, facts in sorted(counted_, key=lambda row: (-row[0], row[1]))
            ),
        ]

    def __repr__(self) -> str:
        """Return the numbers of links, counters, episodes and replicas in one line."""
        learned = counted(len(self.links), "link") + " of " + counted(len(self.links.tables), "behaviour")
        lived = counted(sum(self.experience.episodes.values()), "episode")
        by = counted(len(self.experience.episodes), "replica")
        return f"Memory({learned}, {counted(len(self.experience), 'counter')} of {lived} by {by}, in {self.scene})"

    def said(self) -> str:
        """Return the numbers of episodes, rules, orders of goals, methods and links as a sentence."""
        lived = counted(sum(self.experience.episodes.values()), "episode")
        links = f"{counted(len(self.links), 'link')} of {counted(len(self.links.tables), 'behaviour')}"
        kinds = [
            counted(sum(isinstance(one, kind) for one in self.experience.said.values()), *nouns)
            for kind, *nouns in (
                (LearnedRule, "rule"),
                (LearnedOrder, "order of goals", "orders of goals"),
                (Method, "method"),
            )
        ]
        return f"{lived} so far: {', '.join(kinds)}; of the paper's memory {links}."

    def __rich__(self) -> Group:
        """Return a summary and the first learned rules for rich."""
        from rich.console import Group

        return Group(self.said(), self.advice(20).__rich__())

    def _repr_html_(self) -> str:
        from confab.page.markup import styled, tag
        from confab.page.pieces import table

        shown = [table(list(t.columns), list(t)) for t in (self.advice(20), self.table(20)) if len(t)]
        return styled(tag("p", self.said()), *shown)


def _labels(scene: Known) -> Callable[[], Labels]:
    """Return a function that reads the labels of a scene's terms on demand."""

    @cache
    def read() -> Labels:
        from confab.labels import labels_of

        return labels_of(scene.knowledge, scene.names, scene.problem)

    return read


def preferred(say: Sayings, facts: Mapping[RoleFact, tuple[float, float]]) -> list[str]:
    """Return the strongest recent preferences between individuals as sentences, the strongest first."""
    clear = sorted(((abs(c - p), say.asked(fact, {}), c - p) for fact, (c, p) in facts.items()), reverse=True)
    return [f"{'lately' if lead > 0 else 'not lately'} {text}" for by, text, lead in clear[:SHOWN] if by >= 0.5]


def counted(number: int, noun: str, many: str = "") -> str:
    """Return a number and a noun, in the singular or the plural `many`, which by default has the ending -s.

    Examples
    --------
    >>> counted(1, "episode"), counted(2, "replica")
    ('1 episode', '2 replicas')
    """
    return f"{number} {noun if number == 1 else many or f'{noun}s'}"


def endpoint(source: str | Path) -> str | None:
    """Return the URL that a text or a path contains; return None for the name of a file.

    If `Path` has removed a slash of the URL, the slash is restored.

    Examples
    --------
    >>> endpoint(Path("http://localhost:7878/query")), endpoint("memory.ttl")
    ('http://localhost:7878/query', None)
    """
    match = re.match(r"(https?):/+(.*)", str(source))
    return f"{match[1]}://{match[2]}" if match else None


def memory_at(target: Path, scene: Known) -> Memory:
    """Return the memory in a file or at an endpoint; return a new memory if the file is missing or empty."""
    return Memory.load(target, scene) if endpoint(target) or has_content(target) else Memory.of(scene)


def undisturbed(target: str | Path) -> AbstractContextManager[None]:
    """Lock a memory file, so that no other writer changes it. An endpoint needs no lock, since each replica has its own graph."""
    return nullcontext() if endpoint(target) else alone(Path(target))


def failed_steps(problem: Problem, episode: Episode) -> Iterator[tuple[Problem, Step, tuple[int, ...]]]:
    """Yield each failed first-level step of an episode, with a problem and the path of the failed primitive.

    Each step is yielded twice: with a problem in the state of the failure, and with a problem in the episode's initial state.
    """
    plans = [*episode.planned.steps, *(step for replan in episode.replans for step in replan.steps)]
    for failure in episode.failures:
        wanted = failure.step.behavior, failure.step.arguments
        for step in plans:
            under = [(low.behavior, low.arguments) for low in Plan((step,)).primitives]
            if step.path == failure.step.path[:1] and wanted in under:
                for state in (failure.state, episode.initial):
                    yield replace(problem, initial=state, goal=episode.goal), step, failure.step.path
                break


def _scene_and_plan(scene: Known | HasSceneAndPlan, plan: AnyPlan | None) -> tuple[Known, AnyPlan]:
    """Return a scene and its plan, given as two arguments or as one object, such as a result; else raise `TypeError`."""
    if plan is not None:
        return cast("Known", scene), plan
    made = cast("HasSceneAndPlan", scene)
    if not hasattr(made, "scene"):
        wanted = "a result or an execution, which has its scene, or a scene and a plan"
        raise TypeError(f"wanted {wanted}; got {type(scene).__name__} alone")
    return made.scene, made
