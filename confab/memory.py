"""The memory at the front desk: load it, learn into it, save it, merge it, look at it.

One file holds both kinds of experience: the counts of lifted facts, from which the planner plans (`reasoner.memory.counts`),
and the paper's links between facts and quantified behaviours, which the paper's mode reads (`reasoner.memory.links`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from confab.accepting import AnyPlan, plan_of
from confab.table import Table
from planner.paper.learning import LearningError
from planner.paper.learning import learn as learn_plan
from planner.plan import Plan, Step
from reasoner.files import alone, write_whole
from reasoner.graph.knowledge import KnowledgeError
from reasoner.memory.counts import Decision, Experience, Tallies
from reasoner.memory.counts_file import FORMAT, Lines, new_replica, parse, probability, pull, push, turtle
from reasoner.memory.links import Links
from reasoner.memory.links_file import links_text, load_links, memory_lines, memory_names
from reasoner.names import Names

if TYPE_CHECKING:
    from rich.console import Group

    from confab.known import Known
    from planner.acting.episode import Episode
    from planner.experience.portfolio import Memory as Advisor
    from reasoner.symbols import Problem


MOST_LINKS = 20_000
"""What would give the paper's memory more links isn't learned for the paper's mode, which plans small scenes alone."""


@dataclass
class Memory:
    """A confabulation memory.

    Attributes
    ----------
    links : Links
        The paper's p(situated object instance | quantified behaviour).
    names : Names
        Leads short names to IRIs.
    scene : str
        IRI of the scene that the memory file imports.
    experience : Experience
        Counts of what was chosen, passed over and failed, by lifted facts.
    trusted : set of replica
        Whose experience may lead: by default the replica that learns here. With any other, planning is strict.
    """

    links: Links
    names: Names
    scene: str
    experience: Experience = field(default_factory=lambda: Experience(new_replica()))
    trusted: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, scene: Known) -> Memory:
        """Return an empty memory for a scene."""
        return cls(Links(), scene.names, scene.iri)

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
            Whether the experience of every replica may lead, not only of the one that learns into this file.
        lines : Lines, optional
            The file's, if it was read already (`reasoner.memory.links_file.memory_lines`).

        Raises
        ------
        KnowledgeError
            The memory is missing, broken or newer than this program; the message says what to do.
        """
        url = endpoint(source)
        if url is not None:
            names, iri = (scene.names, scene.iri) if scene is not None else (Names(()), url)
            found = cls(Links(), names, iri, pull(url, names))
        else:
            path = Path(source)
            lines = memory_lines(path) if lines is None else lines
            iri, names = (scene.iri, scene.names) if scene is not None else memory_names(path, lines)
            found = cls(load_links(path, names, lines), names, iri)
            if ":memoryFormat" in lines.rest or "core#memoryFormat" in lines.rest:
                found.experience = parse(lines, str(path), names)
            elif not len(found.links):
                raise KnowledgeError(f"{path}: holds no memory; without it, 'confab learn' makes a new one")
        found.trusted.update(found.experience.episodes if trust else found.experience.trusts)
        return found

    def learn(self, scene: Known, plan: AnyPlan, failed: tuple[int, ...] | None = None) -> None:
        """Learn from a plan that was carried out from the scene's initial situation.

        Parameters
        ----------
        scene : Scene
        plan : Plan, Result, Execution or file
            Of an execution all is learned, as by `live`.
        failed : path of a step, optional
            The step that failed; what came before it worked, what comes after it wasn't tried.

        Raises
        ------
        KnowledgeError
            The plan can't be done in that situation; nothing is learned then.
        """
        from planner.acting.episode import Episode

        if isinstance(episode := getattr(plan, "episode", None), Episode):
            self.live(scene.problem, episode)
            return
        planned = getattr(plan, "problem", scene.problem)  # in which a result's plan was made
        problem = replace(scene.problem, goal=planned.goal)
        plan = plan_of(plan, problem)
        try:
            lived = decisions_of(problem, plan, failed)
            if failed is None:
                self.links = self._linked(scene, plan)
        except LearningError as error:
            raise KnowledgeError(str(error)) from error
        self.experience.learn(lived)

    def teach(self, scene: Known, plan: AnyPlan) -> None:
        """Learn how a scene is best solved, on its first two levels: see `planner.experience.demonstrations`.

        Parameters
        ----------
        scene : Scene
        plan : Plan, Result or file
            For the paper's links.

        Raises
        ------
        KnowledgeError
            The plan can't be done in the scene's situation; nothing is learned then.
        """
        from planner.experience.choice_points import decisions, single_level
        from planner.experience.demonstrations import example
        from planner.hierarchical.operators import Program

        try:
            links = self._linked(scene, plan_of(plan, scene.problem))
        except LearningError as error:
            raise KnowledgeError(str(error)) from error
        lived: list[Decision] = []
        for level in scene.problem.domain.levels[:2]:
            within = single_level(scene.problem, level)
            lived += decisions(Program(within), within, level, example(scene.problem, level))
        self.links = links
        self.experience.learn(lived)

    def _linked(self, scene: Known, plan: Plan) -> Links:
        """Return the paper's links with a plan learned, or as they are where that would be too many."""
        learned = learn_plan(scene.problem, plan, self.links)
        return learned if len(learned) <= MOST_LINKS else self.links

    def merge(self, other: Memory | str | Path, trust: bool = False) -> None:
        """Take in the counts of another memory, or of its file; with `trust`, they may lead. The paper's links can't be merged."""
        if not isinstance(other, Memory):
            other = Memory.load(other)
        self.experience.merge(other.experience)
        if trust:
            self.trusted.update(other.experience.episodes)

    def trust(self, replicas: Iterable[str]) -> None:
        """Let other replicas' experience lead like its own.

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
        """Learn from what was carried out: what was done, if nobody interfered, and which behaviours were chosen in vain.

        Parameters
        ----------
        problem : Problem
            In which the episode's task was planned.
        episode : Episode
        """
        begun = replace(problem, initial=episode.initial, goal=episode.goal)
        lived: list[Decision] = []
        if not episode.interventions and not episode.failures:
            with suppress(LearningError):  # what was done doesn't follow from what was seen in the beginning
                lived += decisions_of(begun, episode.done)
        lived += vain(begun, episode)
        if lived:
            self.experience.learn(lived)

    def save(self, target: str | Path) -> Path:
        """Write the memory as Turtle, whole or not at all, and return where; to an endpoint, this replica's own counters.

        A file is read back before it replaces anything.

        Raises
        ------
        KnowledgeError
            What was written says something else than this memory; the file stays as it was.
        OSError
            The file can't be written.
        """
        url = endpoint(target)
        self.experience.trusts = self.trusted - {self.experience.replica}
        if url is not None:
            push(url, self.experience, self.names, self.scene)
            return Path(target)
        links = [links_text(self.links, self.names, self.scene)] if len(self.links) else []
        lines = chain(turtle(self.experience, self.names, self.scene), links)
        write_whole(Path(target), lines, check=self._check_written)
        return Path(target)

    def _check_written(self, file: Path) -> None:
        """Raise `KnowledgeError` unless a file says what this memory says."""
        found = memory_lines(file)
        read, links = parse(found, "what was written", self.names), load_links(file, self.names, found)
        if read != self.experience or len(links) != len(self.links):
            raise KnowledgeError(
                "what was written can't be read again as it was learned, so the memory stays as it was; please report it"
            )

    @property
    def advisor(self) -> Advisor:
        """The memory as the fast planner takes it."""
        from planner.experience.portfolio import Memory as Advisor

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

    def counts(self, most: int | None = None) -> Table:
        """Return what was counted of single facts, what tells chosen from passed over first."""
        from planner.experience.counts import Ledger

        behaviors: dict[str, Tallies] = {}
        for conclusion, patterns in self.experience.totals().items():
            behaviors.setdefault(conclusion.behavior, {})[conclusion] = patterns
        rows: list[tuple[float, tuple[str, ...]]] = []
        for behavior, tallies in behaviors.items():
            ledger = Ledger(tallies)
            sums = ledger.sums()
            for (fact, value), code in ledger.code.items():
                c, p = (float(counts[code]) for counts in sums.values)
                share = (
                    f"{c / sums.chosen if sums.chosen else 0:.2f}",
                    f"{p / sums.passed if sums.passed else 0:.2f}",
                )
                relevance = float(sums.relevance[ledger.facts[fact]])
                rows.append((relevance, (behavior, fact, value, f"{c:g}", f"{p:g}", *share)))
        rows.sort(key=lambda row: (-row[0], row[1]))
        columns = ("behaviour", "fact", "value", "chosen", "not", "p(value | chosen)", "p(value | not)", "relevance")
        return Table(columns, tuple((*row, f"{relevance:.2f}") for relevance, row in rows[:most]))

    def __repr__(self) -> str:
        """Return how much was learned."""
        learned = counted(len(self.links), "link") + " of " + counted(len(self.links.tables), "behaviour")
        lived = counted(sum(self.experience.episodes.values()), "episode")
        by = counted(len(self.experience.episodes), "replica")
        return f"Memory({learned}, {counted(len(self.experience), 'counter')} of {lived} by {by}, in {self.scene})"

    def said(self) -> str:
        """Return how much was learned, as a sentence."""
        lived = counted(sum(self.experience.episodes.values()), "episode")
        links = f"{counted(len(self.links), 'link')} of {counted(len(self.links.tables), 'behaviour')}"
        counters = counted(len(self.experience), "counter")
        return f"{lived} so far, {counters} of what was chosen and what wasn't; of the paper's memory {links}."

    def __rich__(self) -> Group:
        """Return what was learned for rich, what tells chosen from passed over first."""
        from rich.console import Group

        return Group(self.said(), self.counts(20).__rich__())

    def _repr_html_(self) -> str:
        from confab.report.markup import styled, tag
        from confab.report.pieces import table

        shown = [table(list(t.columns), list(t)) for t in (self.counts(20), self.table(20)) if len(t)]
        return styled(tag("p", self.said()), *shown)


def counted(number: int, noun: str) -> str:
    """Return a number with its noun.

    Examples
    --------
    >>> counted(1, "episode"), counted(2, "replica")
    ('1 episode', '2 replicas')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def endpoint(source: str | Path) -> str | None:
    """Return the URL of a SPARQL endpoint, even one that a path has cut short; None for a file.

    Examples
    --------
    >>> endpoint(Path("http://localhost:7878/query")), endpoint("memory.ttl")
    ('http://localhost:7878/query', None)
    """
    match = re.match(r"(https?):/+(.*)", str(source))
    return f"{match[1]}://{match[2]}" if match else None


def undisturbed(target: str | Path) -> AbstractContextManager[None]:
    """Let nobody else rewrite a memory file until this is done; at an endpoint every replica has its own graph anyway."""
    return nullcontext() if endpoint(target) else alone(Path(target))


def decisions_of(problem: Problem, plan: Plan, failed: tuple[int, ...] | None = None) -> list[Decision]:
    """Return the decisions of a plan: of its first level, and of the next one seen as a problem of its own.

    Raises
    ------
    LearningError
        A step's preconditions don't hold where it is done.
    """
    from planner.experience.choice_points import Ground, decisions, single_level
    from planner.hierarchical.operators import Program

    found: list[Decision] = []
    tops: Sequence[Step] = plan.steps
    for level in problem.domain.levels[:2]:
        steps = [step for step in plan.walk() if step.level == level]
        if any(step.level > level for step in tops):
            continue  # part of the plan was made without this level
        at = None
        if failed is not None:
            at = next((i for i, step in enumerate(steps) if failed[: len(step.path)] == step.path), None)
        grounds: list[Ground] = [(step.behavior, step.arguments) for step in steps]
        within = single_level(problem, level)
        if grounds:
            found += decisions(Program(within), within, level, grounds, at)
    return found


def vain(problem: Problem, episode: Episode) -> list[Decision]:
    """Return the behaviours of the upper levels that were begun in an episode and failed, where they can still be described."""
    from planner.experience.choice_points import Field, single_level
    from planner.hierarchical.operators import Program

    plans = [*episode.planned.steps, *(step for replan in episode.replans for step in replan.steps)]
    found: list[Decision] = []
    for failure in episode.failures:
        wanted = failure.step.behavior, failure.step.arguments
        for level in problem.domain.levels[:2]:
            above = next(
                (
                    step
                    for step in Plan(tuple(plans)).walk()
                    if step.level == level
                    and step.path == failure.step.path[: len(step.path)]
                    and any((under.behavior, under.arguments) == wanted for under in Plan((step,)).primitives)
                ),
                None,
            )
            if above is None:
                continue
            within = single_level(problem, level)
            for state in (failure.state, episode.initial):
                field = Field(Program(within), replace(within, initial=state), level)
                candidate = field.candidate((above.behavior, above.arguments))
                if candidate is not None:
                    found.append(Decision(candidate, succeeded=False))
                    break
    return found


__all__ = ["FORMAT", "Memory", "decisions_of", "probability"]
