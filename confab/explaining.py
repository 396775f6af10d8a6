"""Explanation of why a memory prefers a behaviour: the learned rule, the rule's episodes, and the weight of each fact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from confab.lifted import Sayings
from confab.page.markup import styled, tag
from confab.planner.experience.advice import Advisor
from confab.planner.experience.evidence import FactReader
from confab.planner.experience.following import RulePolicy
from confab.planner.experience.instances import RuleInstance
from confab.planner.hierarchical.call import Call, compiled
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.memory.experience import ITSELF, Ground, RoleFact, Tally
from confab.reasoner.problem import Problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from confab.labels import Labels
    from confab.memory import Memory

SHOWN = 8


@dataclass(frozen=True)
class Why:
    """A fact with its values for the chosen behaviour and the alternative, and its weight for the chosen behaviour."""

    fact: str
    chosen: str
    other: str
    weight: float
    says: str = ""
    says_other: str = ""


@dataclass(frozen=True)
class Explanation:
    """An explanation of the preference for the behaviour `chosen` over the behaviour `other`.

    Each of the `reasons` has a weight, which is a difference of natural log odds. `lead` is the sum of the weights. `rule` is the
    learned rule as a sentence, and `behind` tells from which episodes the rule comes. If the memory has no advice, the text
    `note` says so.
    """

    chosen: str
    other: str
    lead: float
    reasons: tuple[Why, ...]
    rule: str = ""
    behind: str = ""
    note: str = ""

    def json(self) -> dict[str, Any]:
        """Return the explanation as JSON data."""
        return asdict(self)

    def _repr_html_(self) -> str:
        if not self.other:
            return styled(tag("p", str(self)))
        rows = [
            tag("tr", tag("td", f"{why.weight:+.2f}", class_="number"), tag("td", why.says or f"{why.fact}: {why.chosen}"),
                tag("td", why.says_other or why.other))
            for why in self.reasons[:12]
        ]  # fmt: skip
        head = tag("tr", [tag("th", name) for name in ("weight", self.chosen, f"not: {self.other}")])
        note = tag("p", self.note, class_="note") if self.note else None
        return styled(tag("p", f"lead {self.lead:+.2f}"), tag("div", tag("table", head, rows), class_="scroll"), note)

    def __str__(self) -> str:
        """Return the explanation in a few lines."""
        lines = [f"{self.chosen}{': there was no alternative' if not self.other else f', not {self.other}'}"]
        if self.rule:
            lines += [f"  the rule: {self.rule}", f"  behind it: {self.behind}"]
        if self.other and self.reasons:
            lines.append(f"  cogency speaks {'for' if self.lead >= 0 else 'against'} it by {abs(self.lead):.2f}:")
        for why in self.reasons[:SHOWN]:
            there = f"; there: {why.says_other or why.other}" if why.other else ""
            lines.append(f"  {why.weight:+6.2f}  {why.says or f'{why.fact}: {why.chosen}'}{there}")
        return "\n".join([*lines, *([f"  ({self.note})"] if self.note else [])])

    __rich__ = __str__

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the weights as bars, and save the chart if a file is given.

        Weights for the chosen behaviour go to the right, weights against it to the left.
        """
        from confab.picturing import save, words_as_they_are

        with words_as_they_are():
            figure = self._figure()
            if path is not None:
                save(figure, Path(path), dpi=120)
        return figure

    def _figure(self) -> Figure:
        from matplotlib.figure import Figure

        shown = self.reasons[:12][::-1]
        figure = Figure(figsize=(11, 2.5 + 0.45 * len(shown)), layout="constrained")
        axes = figure.subplots()
        axes.barh(
            [fill(f"{why.fact}: {why.chosen} / {why.other}", 60) for why in shown],
            [why.weight for why in shown],
            color=["tab:green" if why.weight > 0 else "tab:red" for why in shown],
        )
        axes.axvline(0, color="black", linewidth=0.8)
        axes.set_xlabel("difference of ln odds")
        axes.set_title(f"{self.chosen}\nnot {self.other}", fontsize=10)
        return figure


def explain(
    problem: Problem,
    memory: Memory,
    steps: Sequence[Ground],
    number: int = 0,
    against: Ground | None = None,
    labels: Labels | None = None,
) -> Explanation:
    """Explain why memory prefers a step of a plan to an alternative.

    Parameters
    ----------
    problem : Problem
    memory : Memory
    steps : sequence of behaviour and arguments
        All steps of the plan on one level.
    number : int
        The index in `steps` of the step to be explained.
    against : behaviour and arguments, optional
        The alternative; by default the behaviour with the highest cogency (score) among the other behaviours that the rules advise
        in the same state.
    labels : Labels, optional
        The labels that the text uses for individuals.

    Raises
    ------
    KnowledgeError
        The step doesn't exist or isn't applicable, or the alternative isn't applicable in the same state.
    """
    if not 0 <= number < len(steps):
        raise KnowledgeError(f"no step {number}: the plan has {len(steps)} on this level, counted from 0")
    advisor = memory.advisor
    call = Call(problem, compiled(problem), None, 1)
    for step in steps[:number]:
        done = call.space.forward[step[0]](*step[1])
        if done is None:
            raise KnowledgeError(f"{_words(step)}: its preconditions don't hold there")
        call.space.apply(done[1])
    for asked_of, trouble in (
        (steps[number], "its preconditions don't hold there"),
        (against, "could not be done there"),
    ):
        if asked_of is not None and call.space.forward[asked_of[0]](*asked_of[1]) is None:
            raise KnowledgeError(f"{_words(asked_of)}: {trouble}")
    say = Sayings(labels)
    policy = RulePolicy(call, advisor.rules, advisor.orders)
    every = list(policy.every(policy.open()))
    alternatives = [c for c in every if not policy.waits(c.goal)] or every
    reader = FactReader(call.program, call.table, call.goal)
    chosen = _best([c for c in every if c.ground == steps[number]], advisor, reader)
    asked = (
        [c for c in alternatives if c.ground != steps[number]]
        if against is None
        else [c for c in every if c.ground == against]
    )
    other = _best(asked, advisor, reader)
    what = say.step(*steps[number])
    ground = other.ground if other is not None else against
    instead = say.step(*ground) if ground is not None else ""
    if chosen is None:
        note = f"memory has no rule that would do {what} there"
        return Explanation(what, instead, 0.0, (), note=note)
    note = "" if other is not None or against is None else f"memory has no rule that would do {instead} there"
    reasons = _differences(chosen, other, advisor, reader, say) if other is not None else ()
    return Explanation(
        what,
        instead,
        sum(why.weight for why in reasons),
        reasons,
        say.rule(chosen.rule),
        behind(memory, chosen.rule.name),
        note,
    )


def behind(memory: Memory, name: str) -> str:
    """Return the counts of a rule (chosen, passed over, failed) and the numbers of episodes of each replica, as text."""
    tally = memory.experience.totals().get(name, {}).get(ITSELF, Tally())
    those = {replica for (replica, epoch), counts in memory.experience.counts.items() if not epoch and name in counts}
    lived = ", ".join(f"{memory.experience.episodes.get(replica, 0)} of {replica}" for replica in sorted(those))
    of = f", within the episodes {lived}" if lived else ""
    return f"chosen {tally.chosen}, passed over {tally.passed_over}, failed {tally.failed} time{'s' * (tally.failed != 1)}{of}"


def _best(alternatives: Sequence[RuleInstance], advisor: Advisor, reader: FactReader) -> RuleInstance | None:
    """Return the rule instance with the highest cogency (score), or None if there is no instance."""

    def key(c: RuleInstance) -> float:
        facts, individual = reader.facts(c.rule, c.roles), reader.individuals(c.rule, c.roles)
        return advisor.scorer.cogency(c.rule, facts, individual)

    return max(alternatives, key=key, default=None)


def _differences(
    chosen: RuleInstance, other: RuleInstance, advisor: Advisor, reader: FactReader, say: Sayings
) -> tuple[Why, ...]:
    """Return the differences between the cogencies (scores) of two rule instances, fact by fact, the greatest difference first."""
    facts: list[dict[str, tuple[RoleFact, float]]] = []
    for c in (chosen, other):
        factors = advisor.scorer.factors(c.rule, reader.facts(c.rule, c.roles), reader.individuals(c.rule, c.roles))
        facts.append({f.fact[0]: (f.fact, f.weight) for f in factors})
    here, there = facts
    roles = [dict(zip((role for role, _ in c.rule.kinds), c.roles, strict=True)) for c in (chosen, other)]
    found = []
    for asks in {**here, **there}:
        a, b = here.get(asks), there.get(asks)
        weight = (a[1] if a else 0.0) - (b[1] if b else 0.0)
        if abs(weight) > 1e-12:
            if asks == "":
                found.append(Why("how often the rule is chosen", "", "", weight, "how often the rule is chosen"))
                continue
            says, says_other = (say.asked(x[0], r) if x else "" for x, r in zip((a, b), roles, strict=True))
            found.append(Why(asks, a[0][1] if a else "–", b[0][1] if b else "–", weight, says, says_other))
    return tuple(sorted(found, key=lambda why: (-abs(why.weight), why.fact)))


def _words(ground: Ground) -> str:
    return " ".join((ground[0], *ground[1]))
