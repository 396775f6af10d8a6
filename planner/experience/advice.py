"""Planning with experience, which may lead but not spoil.

=========  ====================================================================================================
guarded    rules lead from the beginning on, for those kinds of goals that they have reached, and as often as not; where that
           is none, they are tried beside the search, with a fifth of its expansions
leading    rules lead whatever their record is
strict     rules are tried beside the search, with a twentieth of its expansions (`planner.experience.racing`)
=========  ====================================================================================================

Rules act inside of goals in series and of refinements, on every level, before either is searched (`planner.experience.leading`).
That there is no plan is for search to prove. Memory that isn't trusted runs in strict mode whatever was asked for, and one that
knows none of the goals isn't asked at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

from planner.experience.chaining import Candidate
from planner.experience.evidence import Judge, View
from planner.experience.leading import Guide, rules_in, usable
from planner.experience.matching import Bind
from planner.experience.racing import raced
from planner.hierarchical import planner as fast
from planner.hierarchical.refinement_cache import Template
from planner.hierarchical.serialization import Call, Compiled
from planner.plan import Limits, Outcome
from reasoner.amounts import meets
from reasoner.memory.experience import ITSELF, Counts, Experience, Method, Order, Rule, Tally
from reasoner.symbols import Problem

STRICT, GUARDED = 20, 5
"""One of so many expansions rules may have beside the search: in strict mode, and where they have reached nothing yet."""


@dataclass
class Memory:
    """Experience as the planner takes it.

    Parameters
    ----------
    experience : Experience
    trusted : bool
        Whether it may lead; else it runs in strict mode.
    """

    experience: Experience
    trusted: bool = True

    @cached_property
    def rules(self) -> list[Rule]:
        """The rules that may be followed."""
        return rules_in(self.experience)

    @cached_property
    def orders(self) -> list[Order]:
        """The orders that hold."""
        return usable(self.experience)

    @cached_property
    def totals(self) -> Counts:
        """What was counted."""
        return self.experience.totals()

    @cached_property
    def judge(self) -> Judge:
        """What says how cogent a rule is."""
        return Judge(self.experience)

    def knows(self, problem: Problem) -> bool:
        """Whether there is a rule for some open goal."""
        open_ = {s.situation for s, value in problem.goal.items() if not meets(problem.initial.get(s), value)}
        return any(rule.goal.situation in open_ and rule.does[0] in problem.domain.behaviors for rule in self.rules)

    def record(self, rule: Rule) -> Tally:
        """Return how often rules for such goals of a task reached them, and how often not."""
        return self.totals.get(rule.goals.name, {}).get(ITSELF, Tally())

    def helps(self, rule: Rule) -> bool:
        """Whether rules for such goals have reached some, and as often as not."""
        return self.record(rule).chosen >= max(1, self.record(rule).failed)

    def harms(self, rule: Rule) -> bool:
        """Whether they have failed more often than not."""
        return self.record(rule).chosen < self.record(rule).failed

    def share(self, problem: Problem, mode: str) -> int | None:
        """Return one of how many expansions rules may have beside the search; None where they lead."""
        if mode == "strict" or not self.trusted:
            return STRICT
        open_ = {s.situation for s, value in problem.goal.items() if not meets(problem.initial.get(s), value)}
        if mode == "guarded" and not any(rule.goal.situation in open_ and self.helps(rule) for rule in self.rules):
            return GUARDED
        return None

    def guide(self, call: Call, mode: str, joins: dict[str, Bind | None] | None = None) -> Guide:
        """Return the rules bound to a call, with what says which of them is most cogent; `joins` as for `Guide`."""
        view = View(call.program, call.table, call.goal)

        def score(c: Candidate) -> float:
            return self.judge.told(view, c.rule, c.roles)

        upper = {b.name for b in call.program.domain.at_level(call.program.levels[0])}
        rules = [rule for rule in self.rules if mode != "guarded" or rule.does[0] not in upper or not self.harms(rule)]
        return Guide(call, rules, self.orders, score, joins)

    def warmed(self, using: Compiled) -> Compiled:
        """Return what was compiled, with the methods that did more good than harm as refinements to try first."""
        templates = {name: list(known) for name, known in using.templates.items()}
        for name, one in sorted(self.experience.said.items()):
            if isinstance(one, Method) and name not in self.experience.disabled and self._fits(one, using):
                tally = self.totals.get(name, {}).get(ITSELF, Tally())
                template = Template(one.steps, one.open)
                known = templates.setdefault(one.behavior, [])
                if tally.failed <= tally.chosen and template not in known:
                    known.append(template)
                    known.sort(key=lambda template: len(template.steps))
        return replace(using, templates=templates)

    def _fits(self, method: Method, using: Compiled) -> bool:
        """Whether a domain has the behaviours of a method, with as many roles."""
        behaviors = using.program.domain.behaviors
        own = behaviors.get(method.behavior)
        if own is None or len(own.parameters) + len(using.program.variables[method.behavior]) != method.roles:
            return False
        situations = using.program.domain.situations
        return all(
            name in behaviors and len(behaviors[name].parameters) == len(places) for name, places in method.steps
        ) and all(
            role.kind in using.program.problem.classes
            and (role.source is None or role.source[0] in situations)
            and (role.becomes is None or role.becomes in situations)
            for role in method.open
        )


def plan(
    problem: Problem,
    memory: Memory | None = None,
    mode: str = "guarded",
    limits: Limits = Limits(),  # noqa: B008 - frozen
    using: Compiled | None = None,
    improve: int = fast.IMPROVEMENTS,
    leave_levels: bool = True,
) -> Outcome:
    """Plan with experience.

    Parameters
    ----------
    problem : Problem
    memory : Memory, optional
    mode : str
        ``strict``, ``guarded`` or ``leading``: how far experience may lead.
    limits, using, improve, leave_levels
        As for `planner.hierarchical.planner.plan`.

    Returns
    -------
    Outcome
        `search` counts the steps of rules that were tried as expansions.
    """
    using = using or fast.compiled(problem)
    if memory is None or not memory.knows(problem):
        return fast.plan(problem, limits=limits, improve=improve, using=using, leave_levels=leave_levels)
    joins: dict[str, Bind | None] = {}

    share = memory.share(problem, mode)
    if share is not None:

        def guide(call: Call) -> Guide:
            return memory.guide(call, "leading", joins)

        return raced(problem, guide, share, limits, using, improve, leave_levels)

    def advised(call: Call) -> None:
        call.advise(memory.guide(call, mode, joins))

    warm = memory.warmed(using)
    return fast.plan(problem, limits=limits, improve=improve, using=warm, leave_levels=leave_levels, advised=advised)


def planner_with(memory: Memory, mode: str = "guarded") -> Callable[[Problem], Outcome]:
    """Return what plans any problem of one domain with experience."""
    return lambda problem: plan(problem, memory, mode)
