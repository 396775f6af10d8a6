"""Why this behaviour and not that one: the summands of cogency themselves, as text, JSON and a picture.

Facts often say the same thing in other words. What is named first is a fact together with its paraphrases (`also`), without which
the choice would have been less clear: memory is asked again as if they had never been looked at, and the lead over the alternative
shrinks by `drop`, or turns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from confab.lifted import sentence
from confab.report.markup import styled, tag
from planner.experience.choice_points import Field, Ground, single_level
from planner.experience.scoring import TOGETHER, Judge
from planner.hierarchical.operators import Program
from reasoner.graph.knowledge import KnowledgeError
from reasoner.memory.counts import Candidate
from reasoner.symbols import Problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from confab.labels import Labels
    from confab.memory import Memory

SHOWN = 8
LEAST_DROP = 0.01  # of the lead
PRIOR = "how often it is chosen at all"


@dataclass(frozen=True)
class Why:
    """One fact: what it is of the chosen behaviour and of the alternative, and how much it spoke for the choice.

    `says` and `says_other` say this in sentences, where labels were given.
    """

    fact: str
    chosen: str
    other: str
    weight: float
    drop: float | None = None
    also: tuple[str, ...] = ()
    says: str = ""
    says_other: str = ""


@dataclass(frozen=True)
class Explanation:
    """Why `chosen` was preferred to `other`; weights are differences of ln odds, `lead` is their sum.

    `note` says where memory wasn't asked, or has nothing to say.
    """

    chosen: str
    other: str
    lead: float
    reasons: tuple[Why, ...]
    note: str = ""

    def json(self) -> dict[str, Any]:
        """Return the explanation as JSON data."""
        return asdict(self)

    def __rich__(self) -> str:
        """Return the explanation for rich."""
        return str(self)

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
        if not self.other:
            return f"{self.chosen}: there was no alternative"
        how = (
            ""
            if self.lead > 1e-6
            else ", to memory just as good"
            if self.lead > -1e-6
            else ", which memory would rather have"
        )
        lines = [f"{self.chosen}, not {self.other}{how} (lead {self.lead:+.2f}), because"]
        for why in self.reasons[:SHOWN]:
            also = (
                f" (in other words: {', '.join(why.also[:2])}{' …' if len(why.also) > 2 else ''})" if why.also else ""
            )
            drop = "" if why.drop is None else f"; without it the lead is {self.lead - why.drop:+.2f}"
            if why.says:
                there = f"; there: {why.says_other}" if why.says_other else ""
                also = f" ({len(why.also)} more say so in other words)" if why.also else ""
                lines.append(f"  {why.weight:+6.2f}  {why.says}{there}{also}{drop}")
            else:
                lines.append(f"  {why.weight:+6.2f}  {why.fact}: {why.chosen}, there {why.other}{also}{drop}")
        return "\n".join([*lines, *([f"({self.note})"] if self.note else [])])

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw what spoke for the choice (right) and against it (left), and save the picture if a file is given."""
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
    """Explain one step of a plan.

    Parameters
    ----------
    problem : Problem
    memory : Memory
    steps : sequence of behaviour and arguments
        The plan's steps on one level, from the problem's initial state.
    number : int
        Which of them is to be explained.
    against : behaviour and arguments, optional
        The alternative; if left out, the most cogent one.
    labels : Labels, optional
        To say it in sentences.

    Raises
    ------
    KnowledgeError
        No such step; a step that can't be done; an alternative that isn't applicable there.
    """
    if not 0 <= number < len(steps):
        raise KnowledgeError(f"no step {number}: the plan has {len(steps)} on this level, counted from 0")
    level = problem.domain.behaviors[steps[number][0]].level
    within = single_level(problem, level)
    field = Field(Program(within), within, level)
    for step in steps[:number]:
        if not field.do(step):
            raise KnowledgeError(f"{_words(step)}: its preconditions don't hold there")
    chosen = field.candidate(steps[number])
    if chosen is None:
        raise KnowledgeError(f"{_words(steps[number])}: its preconditions don't hold there")
    judge = _judge(memory, field)
    if against is None:
        others = [ground for ground in field.proposals(field.unmet()) if ground != steps[number]]
        mine = judge.cogency(chosen)
        scored = sorted(((_cogency(judge, field, ground), ground) for ground in others), reverse=True)
        against = next((ground for score, ground in scored if score < mine - 1e-6), scored[0][1] if scored else None)
    if against is None:
        return Explanation(_words(steps[number]), "", 0.0, ())
    other = field.candidate(against)
    if other is None:
        raise KnowledgeError(f"{_words(against)} could not be done there, so memory had no choice")
    reasons = differences(judge, chosen, other)
    lead = sum(why.weight for why in reasons)
    behavior = chosen.conclusion.behavior
    note = "" if judge.knows([behavior]) else f"memory has never seen {behavior} chosen or passed over"
    first = _decisive(reasons, lambda facts: _lead(_judge(memory, field, facts), chosen, other), lead)
    named = {first.fact, *first.also} if first else set()
    rest = tuple(why for why in reasons if why.fact not in named)
    shown = (first, *rest) if first else rest
    if labels is None:
        return Explanation(_words(steps[number]), _words(against), lead, shown, note)
    said = tuple(_in_sentences(why, chosen, other, labels) for why in shown)
    return Explanation(_sentence(steps[number], labels), _sentence(against, labels), lead, said, note)


def _sentence(ground: Ground, labels: Labels) -> str:
    behavior = labels.domain.behaviors[ground[0]]
    return labels.behavior(behavior, dict(zip((p.name for p in behavior.parameters), ground[1], strict=True)))


def _in_sentences(why: Why, chosen: Candidate, other: Candidate, labels: Labels) -> Why:
    if why.fact == PRIOR:
        return replace(why, says=PRIOR)
    if why.fact == TOGETHER:
        return why
    says, there = (
        sentence(why.fact, value, labels, dict(candidate.roles))
        for value, candidate in ((why.chosen, chosen), (why.other, other))
    )
    return replace(why, says=says, says_other=there)


def _decisive(reasons: Sequence[Why], lead_without: Callable[[frozenset[str]], float], lead: float) -> Why | None:
    """Return the strongest fact with the paraphrases that have to go with it before the lead shrinks."""
    facts = [why for why in reasons if why.weight > 0 and why.fact not in (PRIOR, TOGETHER)]
    words: list[Why] = []
    for why in facts:
        words.append(why)
        if abs(why.weight - facts[0].weight) < 1e-6 and why is not facts[-1] and facts[len(words)].weight == why.weight:
            continue  # counted alike so far: the same in other words
        drop = lead - lead_without(frozenset(word.fact for word in words))
        if drop > LEAST_DROP * abs(lead):
            also = tuple(word.fact for word in words[1:])
            return replace(words[0], weight=sum(word.weight for word in words), drop=drop, also=also)
    return None


def _lead(judge: Judge, chosen: Candidate, other: Candidate) -> float:
    return judge.cogency(chosen) - judge.cogency(other)


def differences(judge: Judge, chosen: Candidate, other: Candidate) -> list[Why]:
    """Return the summands in which two cogencies differ, the greatest first."""
    mine, theirs = judge.factors(chosen), judge.factors(other)
    prior = (mine[0].weight if mine else 0.0) - (theirs[0].weight if theirs else 0.0)
    here = {factor.fact: factor for factor in mine[1:]}
    there = {factor.fact: factor for factor in theirs[1:]}
    found = [Why(PRIOR, str(chosen.conclusion), str(other.conclusion), prior)]
    for fact in {**here, **there}:
        a, b = here.get(fact), there.get(fact)
        weight = (a.weight if a else 0.0) - (b.weight if b else 0.0)
        if abs(weight) > 1e-12:
            found.append(Why(fact, a.value if a else "–", b.value if b else "–", weight))
    return sorted(found, key=lambda why: (-abs(why.weight), why.fact))


def _judge(memory: Memory, field: Field, without: Iterable[str] = ()) -> Judge:
    behaviors = field.problem.domain.behaviors.values()
    roles = {behavior.name: field.schema.roles(behavior) for behavior in behaviors}
    return Judge(memory.experience, field.problem.parents, roles, frozenset(without))


def _cogency(judge: Judge, field: Field, ground: Ground) -> float:
    candidate = field.candidate(ground)
    return float("-inf") if candidate is None else judge.cogency(candidate)


def _words(ground: Ground) -> str:
    return " ".join((ground[0], *ground[1]))
