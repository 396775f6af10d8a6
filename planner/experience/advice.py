"""Planning with experience, which may lead but not spoil.

=========  ====================================================================================================
guarded    rules lead for those kinds of goals that they have reached, and as often as not
leading    rules lead whatever their record is
strict     rules don't lead; their record is kept all the same, wherever an episode is learned
=========  ====================================================================================================

Rules act inside of goals in series and of refinements, on every level, before either is searched
(`confab.planner.experience.following`).
That there is no plan is for search to prove. Where rules don't lead, planning is as without memory: memory that isn't trusted, has
reached no such goals yet, or knows none of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, cached_property

from confab.planner.experience.evidence import Judge, View, fillers
from confab.planner.experience.following import Candidate, Guide, rules_in, usable
from confab.planner.experience.matching import Bind
from confab.planner.hierarchical import planner as fast
from confab.planner.hierarchical.call import Call, Compiled
from confab.planner.hierarchical.methods import Roles
from confab.planner.plan import Limits, Outcome, paused_collection
from confab.reasoner.amounts import meets
from confab.reasoner.memory.experience import ITSELF, Counts, Experience, Method, Order, Rule, Tally
from confab.reasoner.symbols import Problem


@dataclass
class Memory:
    """Experience as the planner takes it.

    Parameters
    ----------
    experience : Experience
    trusted : bool
        Whether it may lead.
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

    def record(self, rule: Rule) -> Tally:
        """Return how often rules for such goals of a task reached them, and how often not."""
        return self.totals.get(rule.goals.name, {}).get(ITSELF, Tally())

    def helps(self, rule: Rule) -> bool:
        """Whether rules for such goals have reached some, and as often as not."""
        return self.record(rule).chosen >= max(1, self.record(rule).failed)

    def harms(self, rule: Rule) -> bool:
        """Whether they have failed more often than not."""
        return self.record(rule).chosen < self.record(rule).failed

    def leads(self, problem: Problem, mode: str) -> bool:
        """Whether rules may lead: those for some open goal, if that is what they have reached before, or what is asked."""
        open_ = {s.situation for s, value in problem.goal.items() if not meets(problem.initial.get(s), value)}
        return (
            mode != "strict"
            and self.trusted
            and any(
                rule.goal.situation in open_
                and rule.does[0] in problem.domain.behaviors
                and (mode == "leading" or self.helps(rule))
                for rule in self.rules
            )
        )

    def guide(
        self, call: Call, mode: str = "leading", joins: dict[str, Bind | None] | None = None, also: Iterable[Rule] = ()
    ) -> Guide:
        """Return rules bound to a call, with what says which of them is cogent, and whom to take; `joins` as for `Guide`."""
        view = cache(lambda: View(call.program, call.table, call.goal))

        def score(c: Candidate) -> float:
            return self.judge.told(view(), c.rule, c.roles)

        def ranked(method: Method, ways: list[Roles]) -> list[Roles]:
            if method.name not in self.judge.preferred:
                return ways
            facts = (fillers(method, way, call.problem) for way in ways)
            told = [self.judge.cogency(method, (), who) for who in facts]
            return [way for _, way in sorted(zip(told, ways, strict=True), key=lambda one: -one[0])]

        upper = {b.name for b in call.program.domain.at_level(call.program.levels[0])}
        rules = [rule for rule in self.rules if mode != "guarded" or rule.does[0] not in upper or not self.harms(rule)]
        return Guide(call, [*rules, *also], self.orders, score, joins, ranked)

    def warmed(self, using: Compiled) -> Compiled:
        """Return what was compiled, with the methods that did more good than harm as refinements to try first."""
        methods = {name: list(known) for name, known in using.methods.items()}
        for name, one in sorted(self.experience.said.items()):
            if isinstance(one, Method) and name not in self.experience.disabled and self._fits(one, using):
                tally = self.totals.get(name, {}).get(ITSELF, Tally())
                known = methods.setdefault(one.behavior, [])
                if tally.failed <= tally.chosen and one not in known:
                    known.append(one)
                    known.sort(key=lambda method: len(method.steps))
        return replace(using, methods=methods)

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
    improve: int = fast.ORDERS,
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
        As for `confab.planner.hierarchical.planner.plan`.

    Returns
    -------
    Outcome
        `search` counts the steps of rules that were tried as expansions.
    """
    if memory is None or not memory.leads(problem, mode):
        return fast.plan(problem, limits=limits, improve=improve, using=using, leave_levels=leave_levels)
    joins: dict[str, Bind | None] = {}

    def advised(call: Call) -> None:
        call.advise(memory.guide(call, mode, joins))

    with paused_collection():
        warm = memory.warmed(using or fast.compiled(problem))
        return fast.plan(
            problem, limits=limits, improve=improve, using=warm, leave_levels=leave_levels, advised=advised
        )
