"""Planning with experience: learned rules propose steps, and may use only a bounded share of the effort.

=========  ====================================================================================================
guarded    rules are used for kinds of goals for which rules succeeded at least as often as failed
leading    rules are used regardless of their record
strict     rules aren't used; their record is still updated when an episode is learned
=========  ====================================================================================================

On every level, rules are tried for goals and for refinements before a search begins (`confab.planner.experience.following`).
Only the search can prove that there is no plan. Experience is used only if the memory is trusted, has rules for the goals, and
has already achieved goals of the same kinds.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, cached_property

from confab.planner.experience.evidence import FactReader, Scorer, fillers
from confab.planner.experience.following import RulePolicy, rules_in, usable
from confab.planner.experience.instances import RuleInstance
from confab.planner.experience.matching import Bind
from confab.planner.hierarchical import planner as fast
from confab.planner.hierarchical.call import Call, Compiled
from confab.planner.hierarchical.methods import Roles
from confab.planner.plan import Limits, Outcome, paused_collection
from confab.reasoner.amounts import meets
from confab.reasoner.memory.experience import ITSELF, Experience, LearnedOrder, LearnedRule, Method, Tallies, Tally
from confab.reasoner.problem import Problem


@dataclass
class Advisor:
    """Experience in the form that the planner uses; its rules are used only if it is trusted."""

    experience: Experience
    trusted: bool = True

    @cached_property
    def rules(self) -> list[LearnedRule]:
        """The rules that the planner may follow."""
        return rules_in(self.experience)

    @cached_property
    def orders(self) -> list[LearnedOrder]:
        """The orders of goals that held in nearly all observed cases."""
        return usable(self.experience)

    @cached_property
    def totals(self) -> Tallies:
        """The counts of all replicas of the memory, added up."""
        return self.experience.totals()

    @cached_property
    def scorer(self) -> Scorer:
        """The scorer of rules."""
        return Scorer(self.experience)

    def record(self, rule: LearnedRule) -> Tally:
        """Return how often rules achieved goals of the rule's kind, and how often rules failed for goals of this kind."""
        return self.totals.get(rule.goals.name, {}).get(ITSELF, Tally())

    def helps(self, rule: LearnedRule) -> bool:
        """Return whether rules have achieved goals of the rule's kind at least as often as rules have failed."""
        return self.record(rule).chosen >= max(1, self.record(rule).failed)

    def harms(self, rule: LearnedRule) -> bool:
        """Return whether rules have failed for goals of the rule's kind more often than rules have succeeded."""
        return self.record(rule).chosen < self.record(rule).failed

    def leads(self, problem: Problem, mode: str) -> bool:
        """Return whether rules may be used: the mode requires rules, or some open goal has rules with a good record."""
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

    def policy(
        self,
        call: Call,
        mode: str = "leading",
        joins: dict[str, Bind | None] | None = None,
        also: Iterable[LearnedRule] = (),
    ) -> RulePolicy:
        """Return the rules for a call, with scores of rules and of individuals in roles; for `joins`, see `RulePolicy`."""
        reader = cache(lambda: FactReader(call.program, call.table, call.goal))

        def score(instance: RuleInstance) -> float:
            return self.scorer.score(reader(), instance.rule, instance.roles)

        def ranked(method: Method, fillings: list[Roles]) -> list[Roles]:
            if method.name not in self.scorer.preferred:
                return fillings
            facts = (fillers(method, filling, call.problem) for filling in fillings)
            scores = [self.scorer.cogency(method, (), individuals) for individuals in facts]
            return [filling for _, filling in sorted(zip(scores, fillings, strict=True), key=lambda one: -one[0])]

        upper = {b.name for b in call.program.domain.at_level(call.program.levels[0])}
        rules = [rule for rule in self.rules if mode != "guarded" or rule.does[0] not in upper or not self.harms(rule)]
        return RulePolicy(call, [*rules, *also], self.orders, score, joins, ranked)

    def warmed(self, using: Compiled) -> Compiled:
        """Return the compiled problem, extended by methods of the experience.

        The added methods have succeeded at least as often as they have failed. The shortest method of a behaviour comes first.
        """
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
        """Return whether a domain has all behaviours, classes and situation types of a method, with the same numbers of arguments.

        The number of parameters and variables of the method's behaviour must equal the number of the method's roles. The steps must
        be of the next level.
        """
        behaviors, levels = using.program.domain.behaviors, using.program.levels
        own = behaviors.get(method.behavior)
        if own is None or len(own.parameters) + len(using.program.variables[method.behavior]) != method.roles:
            return False
        situations, below = using.program.domain.situations, [level for level in levels if level > own.level][:1]
        return all(
            name in behaviors and [behaviors[name].level] == below and len(behaviors[name].parameters) == len(places)
            for name, places in method.steps
        ) and all(
            role.kind in using.program.problem.classes
            and (role.source is None or role.source[0] in situations)
            and (role.becomes is None or role.becomes in situations)
            for role in method.open
        )


def plan(
    problem: Problem,
    memory: Advisor | None = None,
    mode: str = "guarded",
    limits: Limits = Limits(),  # noqa: B008 - frozen
    using: Compiled | None = None,
    improve: int = fast.DEFAULT_WORK,
    leave_levels: bool = True,
    first: Outcome | None = None,
) -> Outcome:
    """Plan with experience, which has influence according to `mode`: ``strict``, ``guarded`` or ``leading``.

    The other parameters are those of `confab.planner.hierarchical.planner.plan`. The counts of the outcome include the steps that
    rules have tried.
    """
    if memory is None or not memory.leads(problem, mode):
        return fast.plan(problem, limits=limits, improve=improve, using=using, leave_levels=leave_levels, first=first)
    joins: dict[str, Bind | None] = {}

    def advised(call: Call) -> None:
        call.advise(memory.policy(call, mode, joins))

    with paused_collection():
        warm = memory.warmed(using or fast.compiled(problem))
        return fast.plan(
            problem, limits=limits, improve=improve, using=warm, leave_levels=leave_levels, advised=advised, first=first
        )
