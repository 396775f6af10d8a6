"""The memory as Python and the command line use it: load, learn, save, merge, show.

One file holds both kinds of experience: rules with counts, which lead the default planner (`confab.reasoner.memory.experience`),
and the paper's links between facts and quantified behaviours, which the paper's mode reads (`confab.reasoner.memory.links`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from confab.accepting import AnyPlan, plan_of
from confab.planner.paper.learning import learn as learn_plan
from confab.planner.plan import Plan, Step
from confab.reasoner.files import alone, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.memory.experience import (
    ITSELF,
    Experience,
    Fact,
    GoalKind,
    LearningError,
    Method,
    Order,
    Rule,
    Tally,
)
from confab.reasoner.memory.experience_file import FORMAT, Lines, new_replica, parse, probability, pull, push, turtle
from confab.reasoner.memory.links import Links
from confab.reasoner.memory.links_file import links_text, load_links, memory_lines, memory_names
from confab.reasoner.names import Names, right_names
from confab.table import Table

if TYPE_CHECKING:
    from rich.console import Group

    from confab.known import Known
    from confab.labels import Labels
    from confab.lifted import Sayings
    from confab.planner.acting.episode import Episode
    from confab.planner.experience.advice import Memory as Advisor
    from confab.reasoner.symbols import Problem


MOST_LINKS = 20_000
"""Maximum number of links. A plan that would exceed it isn't learned for the paper's mode, which plans small scenes only."""
SHOWN = 3
"""Maximum number of preferences of a method that are listed."""


@right_names("a memory", "confab.hints", "MEMORY", "confab.Memory.of(SCENE) or confab.Memory.load(FILE)")
@dataclass
class Memory:
    """A confabulation memory.

    Attributes
    ----------
    links : Links
        The paper's p(situated object instance | quantified behaviour); read from a file on first access.
    names : Names
        Leads short names to IRIs.
    scene : str
        IRI of the scene that the memory file imports.
    experience : Experience
        Rules, orders of goals and methods, with counts of choices, rejections and failures.
    trusted : set of replica
        Replicas whose experience may lead; by default the replica of this memory. With experience of others, planning is
        strict.
    labels : function, optional
        Labels of the scene's terms, looked up when a text needs them.
    """

    linked: Links | Callable[[], Links]
    names: Names
    scene: str
    experience: Experience = field(default_factory=lambda: Experience(new_replica()))
    trusted: set[str] = field(default_factory=set)
    labels: Callable[[], Labels] | None = None

    @property
    def links(self) -> Links:
        """The paper's links."""
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
        cls, source: str | Path, scene: Known | None = None, trust: bool = False, lines: Lines | None = None
    ) -> Memory:
        """Read a memory file, or the memories at a SPARQL endpoint.

        Parameters
        ----------
        source : str or Path
            File, or URL of an endpoint.
        scene : Scene, optional
            Its short names are used for the memory's terms.
        trust : bool
            Whether the experience of every replica may lead, and not only that of the replica that writes this file.
        lines : Lines, optional
            The file's, if it was read already (`confab.reasoner.memory.links_file.memory_lines`).

        Raises
        ------
        KnowledgeError
            The memory is missing, broken or newer than this program; the message states the remedy.
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
                found.experience = parse(lines, str(path), names)
            elif not len(found.links):
                raise KnowledgeError(f"{path}: holds no memory; without it, 'confab learn' makes a new one")
        found.labels = _labels(scene) if scene is not None else None
        found.trusted.update(found.experience.episodes if trust else found.experience.trusts)
        return found

    def learn(self, scene: Known, plan: AnyPlan, failed: tuple[int, ...] | None = None) -> None:
        """Learn from a plan that was carried out from the scene's initial situation.

        Parameters
        ----------
        scene : Scene
        plan : Plan, Result, Execution or file
            The lesson of an execution is the same as that of `live`.
        failed : path of a step, optional
            The step that failed; the steps before it succeeded, the steps after it weren't tried.

        Raises
        ------
        KnowledgeError
            The plan isn't applicable in that situation; the memory is unchanged.
        """
        from confab.planner.acting.episode import Episode
        from confab.planner.experience.lessons import live

        if isinstance(episode := getattr(plan, "episode", None), Episode):
            self.live(scene.problem, episode)
            return
        planned = getattr(plan, "problem", scene.problem)  # in which a result's plan was made
        problem = replace(scene.problem, goal=planned.goal)
        plan = plan_of(plan, problem)
        try:
            links = self._linked(scene, plan) if failed is None else self.links
            live(self.experience, problem, plan, failed)
        except LearningError as error:
            raise KnowledgeError(str(error)) from error
        self.links = links

    def teach(self, scene: Known, plan: AnyPlan) -> None:
        """Learn from solutions of a scene with its goals in several orders: see `confab.planner.experience.lessons`.

        Parameters
        ----------
        scene : Scene
        plan : Plan, Result or file
            The plan that solved it.

        Raises
        ------
        KnowledgeError
            The plan isn't applicable in the scene's situation; the memory is unchanged.
        """
        from confab.planner.experience.lessons import teach

        made = plan_of(plan, scene.problem)
        try:
            links = self._linked(scene, made)
            teach(self.experience, scene.problem, made)
        except LearningError as error:
            raise KnowledgeError(str(error)) from error
        self.links = links

    def _linked(self, scene: Known, plan: Plan) -> Links:
        """Return the paper's links after learning a plan; they are unchanged if there would be too many."""
        learned = learn_plan(scene.problem, plan, self.links)
        return learned if len(learned) <= MOST_LINKS else self.links

    def merge(self, other: Memory | str | Path, trust: bool = False) -> None:
        """Add the counts of another memory or its file; with `trust`, they may lead. The paper's links can't be merged."""
        if not isinstance(other, Memory):
            other = Memory.load(other)
        self.experience.merge(other.experience)
        if trust:
            self.trusted.update(other.experience.episodes)

    def trust(self, replicas: Iterable[str]) -> None:
        """Let the experience of other replicas lead, like that of this memory.

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

    def live(self, problem: Problem, episode: Episode) -> None:
        """Learn from an execution: its steps, if there were no interventions, and the behaviours that failed.

        Parameters
        ----------
        problem : Problem
            The problem of the episode's task.
        episode : Episode
        """
        from confab.planner.experience.lessons import live

        begun = replace(problem, initial=episode.initial, goal=episode.goal)
        failures = list(failed_steps(problem, episode))
        whole = not episode.interventions and not episode.failures
        with suppress(LearningError):  # the executed steps aren't applicable in the initial observation
            if whole or failures:
                live(self.experience, begun, episode.done if whole else Plan(()), failures=failures)

    def save(self, target: str | Path) -> Path:
        """Write the memory as Turtle atomically, and return the path. An endpoint gets only the counters of this replica.

        A file is read back before it replaces the old one.

        Raises
        ------
        KnowledgeError
            The written file differs from this memory; the old file stays.
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
        write_whole(Path(target), lines, check=self._check_written)
        return Path(target)

    def _check_written(self, file: Path) -> None:
        """Raise `KnowledgeError` unless a file has the content of this memory."""
        found = memory_lines(file)
        read, links = parse(found, "what was written", self.names), load_links(file, self.names, found)
        if read != self.experience or len(links) != len(self.links):
            raise KnowledgeError(
                "what was written can't be read again as it was learned, so the memory stays as it was; please report it"
            )

    @property
    def advisor(self) -> Advisor:
        """The memory in the form that the default planner takes."""
        from confab.planner.experience.advice import Memory as Advisor

        mine = {self.experience.replica, *self.trusted}
        return Advisor(self.experience, trusted=set(self.experience.episodes) <= mine)

    def table(self, most: int | None = None) -> Table:
        """Return the paper's links, the most probable first."""
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
        """Return the rules by kind of goal."""
        say, totals = self.sayings(), self.experience.totals()
        rules = [one for one in self.experience.said.values() if isinstance(one, Rule)]
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
        """Return the rules as sentences with their counts, by kind of goal."""
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
        """Return the advice as a page: the rules for each kind of goal, then the orders of goals and the methods."""
        lines = [self.said()]
        for record, rules in self.told(most):
            lines += ["", f"{record}:", *(f"  – {rule}" for rule in rules)]
        others = self.also()[:most]
        return "\n".join([*lines, *(["", "Besides:"] if others else []), *(f"  – {other}" for other in others)])

    def also(self) -> list[str]:
        """Return the learned orders and methods as sentences with their counts."""
        from confab.planner.experience.evidence import DECAY
        from confab.planner.experience.following import usable

        say, totals = self.sayings(), self.experience.totals()
        orders = [
            f"{say.said(order)}: so in {totals[order.name][ITSELF].chosen} cases" for order in usable(self.experience)
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
                f"{text}: {times} times{''.join(f'; {who}' for who in preferred(say, facts))}"
                for times, text, facts in sorted(counted_, key=lambda row: (-row[0], row[1]))
            ),
        ]

    def __repr__(self) -> str:
        """Return the numbers of learned items."""
        learned = counted(len(self.links), "link") + " of " + counted(len(self.links.tables), "behaviour")
        lived = counted(sum(self.experience.episodes.values()), "episode")
        by = counted(len(self.experience.episodes), "replica")
        return f"Memory({learned}, {counted(len(self.experience), 'counter')} of {lived} by {by}, in {self.scene})"

    def said(self) -> str:
        """Return the numbers of learned items as a sentence."""
        lived = counted(sum(self.experience.episodes.values()), "episode")
        links = f"{counted(len(self.links), 'link')} of {counted(len(self.links.tables), 'behaviour')}"
        kinds = [
            counted(sum(isinstance(one, kind) for one in self.experience.said.values()), noun)
            for kind, noun in ((Rule, "rule"), (Order, "order of goals"), (Method, "method"))
        ]
        kinds[1] = kinds[1].replace("order of goalss", "orders of goals")
        return f"{lived} so far: {', '.join(kinds)}; of the paper's memory {links}."

    def __rich__(self) -> Group:
        """Return the learned items for rich, most decisive first."""
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


def preferred(say: Sayings, facts: Mapping[Fact, tuple[float, float]]) -> list[str]:
    """Return the recent preferences for individuals in words, the strongest first."""
    clear = sorted(((abs(c - p), say.asked(fact, {}), c - p) for fact, (c, p) in facts.items()), reverse=True)
    return [f"{'lately' if lead > 0 else 'not lately'} {text}" for by, text, lead in clear[:SHOWN] if by >= 0.5]


def counted(number: int, noun: str) -> str:
    """Return a number with its noun.

    Examples
    --------
    >>> counted(1, "episode"), counted(2, "replica")
    ('1 episode', '2 replicas')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def endpoint(source: str | Path) -> str | None:
    """Return the URL of a SPARQL endpoint, also if a path has removed one of its slashes; None for a file.

    Examples
    --------
    >>> endpoint(Path("http://localhost:7878/query")), endpoint("memory.ttl")
    ('http://localhost:7878/query', None)
    """
    match = re.match(r"(https?):/+(.*)", str(source))
    return f"{match[1]}://{match[2]}" if match else None


def undisturbed(target: str | Path) -> AbstractContextManager[None]:
    """Lock a memory file against other writers; at an endpoint every replica has a graph of its own."""
    return nullcontext() if endpoint(target) else alone(Path(target))


def failed_steps(problem: Problem, episode: Episode) -> Iterator[tuple[Problem, Step, tuple[int, ...]]]:
    """Yield the behaviours of the most abstract level that failed in an episode, each with the state and the failed conditions."""
    plans = [*episode.planned.steps, *(step for replan in episode.replans for step in replan.steps)]
    for failure in episode.failures:
        wanted = failure.step.behavior, failure.step.arguments
        for step in plans:
            under = [(low.behavior, low.arguments) for low in Plan((step,)).primitives]
            if step.path == failure.step.path[:1] and wanted in under:
                for state in (failure.state, episode.initial):
                    yield replace(problem, initial=state, goal=episode.goal), step, failure.step.path
                break


__all__ = ["FORMAT", "GoalKind", "Memory", "Order", "probability"]
