"""Sentences that explain why a step is in a plan (`Result.why`), and why an alternative isn't in the plan (`Result.why_not`)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias, cast

from confab.formats import AccountJson, BecauseJson, WhyNotJson
from confab.labels import Labels
from confab.page.markup import Markup, styled, tag
from confab.planner.causal_links import Need, NeedKind, Purpose
from confab.planner.contrast import Ask, Contrast, NoChoiceError, instead_of, with_choice
from confab.planner.finding import StepPosition, UnknownStepError, find
from confab.planner.finding import numbers as numbered
from confab.planner.levels import levels_left
from confab.planner.plan import Outcome, Plan, SoftGoal, Status, Step
from confab.planner.plan_costs import cost_of
from confab.planner.validation import unmet_goals
from confab.reasoner.amounts import written
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import check
from confab.reasoner.names import known_as, nearest
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import parse_fact, some_of
from confab.reasoner.symbols import Behavior, Fact, Symbol
from confab.worded import worded_behavior, worded_fact

MOST_TOLD = 12
"""Maximum number of facts of one kind that the text about a certificate lists."""

if TYPE_CHECKING:
    from rich.tree import Tree

    from confab.planner.certificates import Certificate

Replan = Callable[[Sequence[str]], tuple[Problem, Outcome, Labels]]
"""A function that plans for other goals, and returns the problem, the outcome and the labels."""
Path: TypeAlias = "tuple[int, ...]"
Steps: TypeAlias = "Mapping[Path, Step]"
BY = re.compile(r"\s+(?:by|with)\s+(\S+)\s*$")
SHOWN = 3
"""Maximum number of listed reasons for a step."""


@known_as("an explanation")
@dataclass(frozen=True)
class Because:
    """The reasons why a step is in a plan: its effects (`gives`), and the steps and goals that need these effects (`needs`).

    The text `number` names the step. For example, ``L2#3`` is step 3 of level 2; steps are counted from 0.
    """

    number: str
    path: tuple[int, ...]
    id: int
    step: str
    what: str
    gives: tuple[str, ...]
    needs: tuple[str, ...]

    def json(self) -> BecauseJson:
        """Return the reasons as JSON data."""
        lists = {"path": [*self.path], "gives": [*self.gives], "needs": [*self.needs]}
        return cast("BecauseJson", {**asdict(self), **lists})

    def __str__(self) -> str:
        """Return the reasons in a few lines."""
        more = len(self.needs) - SHOWN
        return "\n".join(
            [
                f"{self.number}  {self.what}",
                *(f"  gives   {fact}" for fact in self.gives),
                *(f"  because {need}" for need in self.needs[:SHOWN]),
                *([f"          and {more} more"] if more > 0 else []),
            ]
        )

    __repr__ = __rich__ = __str__

    def reasons(self) -> list[Markup]:
        """Return a short form of the reasons as HTML."""
        more, gives = len(self.needs) - 2, "; ".join(self.gives)
        said = [tag("span", need) for need in self.needs[:2]] + ([tag("span", f"and {more} more")] if more > 0 else [])
        return [
            tag("p", "gives ", tag("span", gives), class_="gives") if gives else Markup(""),
            tag("p", "needed: ", said, class_="why"),
        ]

    def _repr_html_(self) -> str:
        return styled(
            tag("p", tag("b", self.what), " ", tag("small", f"{self.number} · {self.step}")),
            tag("p", "gives ", "; ".join(self.gives), class_="gives"),
            tag("ul", [tag("li", need) for need in self.needs], class_="why"),
        )


@known_as("an explanation")
@dataclass(frozen=True)
class WhyNot:
    """The reasons why an alternative isn't in the plan.

    `answer` is the answer as a sentence. If the alternative is inapplicable, `lacks` has its failing conditions. If a complete plan
    with the alternative was found, `plan` is this plan, and `more` is its additional cost. `breaks` has the conditions of upper
    levels that the plan with the alternative violates and the present plan meets.
    """

    asked: str
    answer: str
    lacks: tuple[str, ...] = ()
    plan: Plan | None = None
    more: float | None = None
    steps: tuple[str, ...] = ()
    breaks: tuple[str, ...] = ()

    def json(self) -> WhyNotJson:
        """Return the answer as JSON data."""
        from confab.interchange import steps_json

        steps = None if self.plan is None else steps_json(self.plan.steps)
        return {
            "asked": self.asked,
            "answer": self.answer,
            "lacks": list(self.lacks),
            "breaks": list(self.breaks),
            "more": self.more,
            "steps": steps,
        }

    def __str__(self) -> str:
        """Return the answer in a few lines."""
        return "\n".join([self.answer, *(f"  {line}" for line in (*self.lacks, *self.breaks, *self.steps))])

    __repr__ = __rich__ = __str__

    def _repr_html_(self) -> str:
        bad, steps = ([tag("li", line) for line in lines] for lines in ((*self.lacks, *self.breaks), self.steps))
        below = (tag("ul", bad, class_="bad") if bad else None, tag("ol", steps) if steps else None)
        return styled(tag("p", self.answer), *below)


@known_as("an explanation")
@dataclass(frozen=True)
class Account:
    """An explanation of each step of a plan, or of the reason why there is no plan.

    `proof` has the claims of the certificate of unsolvability; it is empty without a certificate.
    """

    headline: str
    steps: tuple[Because, ...] = ()
    plan: Plan | None = field(default=None, repr=False)
    proof: tuple[str, ...] = ()

    def json(self) -> AccountJson:
        """Return the explanation as JSON data."""
        return {"headline": self.headline, "steps": [step.json() for step in self.steps], "proof": list(self.proof)}

    def __str__(self) -> str:
        """Return the explanation as text, with a line for each step and its first reason."""
        lines = [self.headline, *(f"  {line}" for line in self.proof)]
        for step in self.steps:
            why = f": {step.needs[0]}" if step.needs else ""
            lines.append(f"{'  ' * len(step.path)}{step.number}  {step.what}{why}")
        return "\n".join(lines)

    __repr__ = __str__

    def __rich__(self) -> Tree:
        """Return the explanation as a tree for rich."""
        from rich.text import Text
        from rich.tree import Tree

        tree = Tree(Text(self.headline), guide_style="dim")
        branches: dict[tuple[int, ...], Tree] = {(): tree}
        for line in self.proof:
            tree.add(Text(line))
        for step in self.steps:
            why = Text(f"  {step.needs[0]}" if step.needs else "", "italic dim")
            branches[step.path] = branches[step.path[:-1]].add(
                Text.assemble((f"{step.number} ", "dim"), step.what, why)
            )
        return tree

    def _repr_html_(self) -> str:
        below: dict[tuple[int, ...], list[Because]] = {}
        for step in self.steps:
            below.setdefault(step.path[:-1], []).append(step)

        def item(step: Because) -> Markup:
            inner = [item(other) for other in below.get(step.path, ())]
            head = [tag("span", step.what, class_="what"), " ", tag("small", step.number)]
            inside = [tag("summary", head), step.reasons(), tag("ul", inner) if inner else None]
            return tag("li", tag("details", inside, open=len(step.path) == 1))

        steps = [item(step) for step in below.get((), ())]
        lines = [tag("li", line) for line in self.proof]
        return styled(tag("p", self.headline), tag("ul", [*lines, *steps], class_="plan"))


# ------------------------------------------------------------------------------------------------------------------ why


def numbers(plan: Plan) -> dict[tuple[int, ...], str]:
    """Return the numbers of all steps by path."""
    return numbered(StepPosition(step.path, step.level, step.id, ()) for step in plan.walk())


def find_step(plan: Plan, asked: int | str | Sequence[int | str] | Step, labels: Labels) -> Step:
    """Return the step that an argument names, for example by words of the step's label (`confab.planner.finding.find_step`).

    Raises
    ------
    KnowledgeError
        No step matches, or several steps match.
    """
    steps = {step.path: step for step in plan.walk()}
    texts = {path: (str(step), labels.name(step.behavior), labels.step(step)) for path, step in steps.items()}
    places = [StepPosition(path, step.level, step.id, texts[path]) for path, step in steps.items()]
    hint = f"steps: {some_of([text for *_, text in texts.values()])}"
    asked = asked.path if isinstance(asked, Step) else asked
    if not isinstance(asked, int | str | Sequence):
        raise KnowledgeError(
            f"{asked!r} names no step; wanted a step of the plan, a number such as L2#3, a path or words"
        )
    try:
        return steps[find(places, asked, hint)]
    except UnknownStepError as error:
        raise KnowledgeError(str(error)) from error


def because(plan: Plan, step: Step, purpose: Purpose, labels: Labels) -> Because:
    """Return the reasons why a step is in a plan."""
    return _because(step, purpose, labels, {other.path: other for other in plan.walk()}, numbers(plan))


def _because(step: Step, purpose: Purpose, labels: Labels, steps: Steps, number: Mapping[Path, str]) -> Because:
    check("explaining the plan")
    needs = tuple(dict.fromkeys(_sentence(need, steps, number, labels) for need in purpose.needs))
    return Because(
        number[step.path],
        step.path,
        step.id,
        str(step),
        labels.step(step),
        tuple(f"{labels.fact(change.fact)} (before: {labels.name(change.before)})" for change in purpose.gives),
        needs or ("no later step and no goal depends on its effects",),
    )


def proved(certificate: Certificate, labels: Labels) -> tuple[str, ...]:
    """Return the claims of a certificate of unsolvability as sentences.

    Parameters
    ----------
    certificate : Certificate
    labels : Labels
        The labels of the facts that the certificate names.
    """
    amounts = {name for name, kind in labels.domain.situations.items() if kind.quantity is not None}
    kept = [Fact(symbol, value) for symbol, value in sorted(certificate.always.items())]
    lines = ["An independent checker has verified this for every reachable state:"]
    lines += _listed("never: ", [labels.fact(fact) for fact in sorted(certificate.never)])
    lines += _listed("always: ", [labels.fact(fact) for fact in kept if fact.symbol.situation not in amounts])
    bounded = [f"{labels.about(fact.symbol)} is {fact.value}" for fact in kept if fact.symbol.situation in amounts]
    lines += _listed("always: ", bounded)
    if certificate.told_apart:
        about = [labels.about(symbol) for symbol in sorted(certificate.told_apart)]
        more = f" and {len(about) - MOST_TOLD} more" * (len(about) > MOST_TOLD)
        cases = f"{certificate.cases} combination{'s' * (certificate.cases != 1)}"
        named = ", ".join(f"“{one}”" for one in about[:MOST_TOLD])
        lines.append(f"of the values of {named}{more}, {cases} {'is' if certificate.cases == 1 else 'are'} reachable")
    constraints = labels.domain.constraints
    for symbol in certificate.bounded:
        constraint = constraints.get(symbol.situation)
        within = f"always: {labels.about(symbol)} is within its bounds"
        lines.append(within if constraint is None else f"constraint: {labels.sentence(str(constraint))}")
    goals = " and ".join(labels.fact(fact) for fact in certificate.unmet[:MOST_TOLD])
    never = "these never hold together" if len(certificate.unmet) > 1 else "this never holds"
    return (*lines, f"The goal requires that {goals}; {never}.")


def _listed(before: str, sentences: Sequence[str]) -> list[str]:
    """Return the first sentences as lines, and a line with the number of further sentences."""
    lines = [f"{before}{sentence}" for sentence in sentences[:MOST_TOLD]]
    return [*lines, *([f"{before}{len(sentences) - MOST_TOLD} facts more"] if len(sentences) > MOST_TOLD else [])]


def account(plan: Plan, purposes: Mapping[tuple[int, ...], Purpose], labels: Labels, headline: str) -> Account:
    """Return an explanation of each step of a plan."""
    by_path, number = {step.path: step for step in plan.walk()}, numbers(plan)
    steps = tuple(_because(step, purposes[path], labels, by_path, number) for path, step in by_path.items())
    return Account(headline, steps, plan)


def _sentence(need: Need, steps: Steps, number: Mapping[Path, str], labels: Labels) -> str:
    facts = " and ".join(labels.fact(change.fact) for change in need.gives)
    if need.kind is NeedKind.GOAL and need.conditions:
        return f"the goal requires that {' and '.join(map(labels.condition, need.conditions))}, which follows from: {facts}"
    if need.kind is NeedKind.GOAL:
        return f"the goal requires that {facts}"
    if need.kind is NeedKind.REST:
        where = f"“{labels.step(steps[need.by])}”" if need.by else "the plan"
        return f"{where} has to end with the rest value: {facts}"
    by = f"“{labels.step(steps[need.by])}” ({number[need.by]})"
    if need.kind is NeedKind.ABOVE:
        return f"it achieves an effect of {by}: {facts}"
    asks = " and ".join(dict.fromkeys(map(labels.condition, need.conditions)))
    if not asks:
        return f"the effect of {by} depends on it: {facts}"
    if asks == facts:
        return f"{by} requires that {asks}"
    before = " and ".join(labels.fact(replace(change.fact, value=change.before)) for change in need.gives)
    return f"{by} requires that {asks}; without this step, {before}"


# -------------------------------------------------------------------------------------------------------------- why not


def why_not(
    asked: str,
    problem: Problem,
    plan: Plan | None,
    labels: Labels,
    ask: Ask,
    replan: Replan,
    instead: Step | None = None,
    soft: Sequence[SoftGoal] = (),
) -> WhyNot:
    """Return why an alternative isn't in the plan.

    Parameters
    ----------
    asked : str
        The alternative: a goal, or a behaviour. A goal is a fact like ``cup2 LOCATION location8``. If a goal ends with ``by
        hand2``, the individual ``hand2`` must take part in the changes of the fact. A behaviour has arguments in the order of its
        parameters, as in ``B2_PICK right_hand cup1``, or by name, as in ``B2_PICK hand=right_hand``. Sentences of explanations,
        such as ``pick cup 1 with right hand``, are also accepted.
    problem, plan
        The problem and its plan; without a plan, the alternative can only be a goal.
    labels : Labels
    ask, replan : callable
        Functions that plan: `ask` plans in a given problem, and `replan` plans in the scene for other goals.
    instead : Step, optional
        The step that the behaviour would replace.
    soft : sequence of SoftGoal, optional
        The soft goals of the task.

    Raises
    ------
    KnowledgeError
        The text mentions terms that the scene doesn't have.
    """
    first, _, rest = asked.strip().partition(" ")
    behavior = problem.domain.behaviors.get(first)
    worded = (
        worded_behavior(problem, labels, asked) if behavior is None else (behavior, _given(problem, behavior, rest))
    )
    if worded is not None:
        if plan is None:
            raise KnowledgeError(
                f"'{asked}' is a behaviour, which can replace a step of a plan, but there is no plan; ask why there is none "
                "(confab explain SCENE, in Python plan().explain()), or ask for a goal: 'object SITUATION value'"
            )
        try:
            found = instead_of(problem, plan, worded[0], dict(worded[1]), ask, instead)
        except NoChoiceError as error:
            return WhyNot(asked, str(error))
        return _step_told(asked, problem, plan, labels, found, "" if instead else ", where the fewest conditions fail")
    by = BY.search(asked)
    fact = BY.sub("", asked.strip())
    if (said := worded_fact(problem, labels, fact)) is not None:
        fact = str(said)
    words = [*fact.split(), "", ""]
    if words[1] not in problem.domain.situations and (not words[2] or first not in problem.individuals):
        known = [*problem.domain.behaviors, *problem.domain.situations]
        hint = nearest(first, problem.domain.behaviors) or nearest(words[1], known)
        example = next((str(Fact(*goal)) for goal in sorted(problem.goal.items())), "cup2 LOCATION location8")
        raise KnowledgeError(
            f"'{asked}' is neither a fact ('{example}', maybe with 'by INDIVIDUAL') nor a behaviour with individuals{hint}"
        )
    return _fact_told(asked, fact, by[1] if by else None, problem, plan, labels, ask, replan, soft)


def _given(problem: Problem, behavior: Behavior, text: str) -> dict[str, str]:
    """Return the individuals that a text assigns to the parameters and variables of a behaviour, by name."""
    names = [p.name for p in behavior.parameters]
    given: dict[str, str] = {}
    for position, word in enumerate(text.split()):
        role, equals, value = word.rpartition("=")
        name = f"?{role.lstrip('?')}" if equals else names[position] if position < len(names) else ""
        if name not in behavior.kinds:
            roles = ", ".join(term.lstrip("?") for term in behavior.kinds)
            raise KnowledgeError(
                f"'{word}': {behavior.name} has no such part{nearest(role, roles.split(', '))} (its parts: {roles})"
            )
        members = problem.classes.get(behavior.kinds[name], ())
        if value not in members:
            raise KnowledgeError(f"'{value}' is no {behavior.kinds[name]}{nearest(value, members)}")
        given[name] = value
    return given


def _step_told(asked: str, problem: Problem, plan: Plan, labels: Labels, found: Contrast, chosen: str) -> WhyNot:
    what = labels.grounded(found.behavior, found.arguments)
    assert found.instead is not None
    place = (
        f"“{labels.step(found.instead)}” ({numbers(plan)[found.instead.path]})"
        if found.instead in list(plan.walk())
        else labels.step(found.instead)
    )
    if found.lacks:
        lacks = tuple(labels.condition(condition) for condition in found.lacks)
        return WhyNot(asked, f"“{what}” isn't applicable. In place of {place}{chosen}, it would require that", lacks)
    if found.plan is not None:
        return _planned(asked, f"“{what}” in the place of {place}", problem, plan, labels, found)
    if found.reason is not None:
        return WhyNot(asked, f"“{what}” in the place of {place}: no plan with this step was found: {found.reason.text}")
    return WhyNot(asked, f"the plan already has this step: {place}", more=0.0)


def _fact_told(
    asked: str,
    fact: str,
    by: str | None,
    problem: Problem,
    plan: Plan | None,
    labels: Labels,
    ask: Ask,
    replan: Replan,
    soft: Sequence[SoftGoal],
) -> WhyNot:
    about, of, *rest = fact.split()
    situation = problem.domain.situations.get(of)
    asked_of = Symbol(of, (about, *rest[: 0 if situation is None else len(situation.arguments) - 1]))
    given = [Fact(*goal) for goal in sorted(problem.goal.items())]
    replaced = [goal for goal in given if goal.symbol == asked_of]
    goals = [str(goal) for goal in given if goal not in replaced]
    try:
        symbol, value = parse_fact(problem, fact)
    except KnowledgeError:  # the whole scene may have an individual that the problem lacks
        problem, outcome, labels = replan([*goals, fact])
        symbol, value = parse_fact(problem, fact)
    else:
        outcome = Outcome(Status.SOLVED, plan)
        if plan is None or problem.goal.get(symbol) != value:
            problem, outcome, labels = replan([*goals, fact])
    words = labels.fact(Fact(symbol, value))
    others = [labels.fact(goal) for goal in replaced if goal.value != value]
    weight = next((goal.weight for goal in soft if goal.fact == Fact(symbol, value)), None)
    kind = "goal" if weight is None else f"soft goal (weight {written(weight)})"
    if by is None and problem.goal.get(symbol) == value and outcome.plan is plan is not None:
        return WhyNot(asked, f"this is a {kind} already: {words}", more=0.0)
    before = 0.0 if plan is None else cost_of(problem, plan)
    base = plan if outcome.plan is None else outcome.plan
    if by is not None and base is not None:
        if not any(by in members for members in problem.classes.values()):
            known = problem.individuals
            raise KnowledgeError(f"unknown individual '{by}' in '{asked}'{nearest(by, known)}")
        try:
            found = with_choice(problem, base, symbol, by, ask)
            if found.plan is None and (kept := {goal.fact.symbol for goal in soft} & problem.goal.keys() - {symbol}):
                found = with_choice(problem.only(kept), base, symbol, by, ask)
        except NoChoiceError as error:
            return WhyNot(asked, str(error))
        words += f", with {labels.name(by)} in every step that changes “{labels.about(symbol)}”"
        found = replace(found, before=before)
    else:
        cost = None if outcome.plan is None else cost_of(problem, outcome.plan)
        found = Contrast(before, plan=outcome.plan, cost=cost, proved=outcome.proved, reason=outcome.reason)
    if found.plan is None:
        which = "" if weight is None else f"the {kind} "
        reason = found.reason.text if found.reason else "no reason is known"
        return WhyNot(asked, f"no plan achieves {which}that {words}: {reason}")
    aside = [f"in place of the goal that {' and '.join(others)}"] if others else []
    if plan is not None:
        aside += _exchanged(problem, found.plan, labels, [goal for goal in soft if goal.fact.symbol != symbol])
    words += f", {', '.join(aside)}," if aside else ""
    return _planned(asked, f"the {kind} that {words}", problem, plan, labels, found)


def _planned(asked: str, what: str, problem: Problem, plan: Plan | None, labels: Labels, found: Contrast) -> WhyNot:
    assert found.plan is not None
    assert found.cost is not None
    steps = tuple(f"{step.id} {labels.step(step)}" for step in found.plan.steps)
    if plan is None:
        return WhyNot(
            asked, f"{what} is possible ({len(found.plan.primitives)} primitives):", (), found.plan, None, steps
        )
    more = found.cost - found.before
    count = f"{len(found.plan.primitives)} primitives instead of {len(plan.primitives)}"
    said = f"costs {more:g} more" if more > 0 else "costs the same" if more == 0 else f"costs {-more:g} less"
    price = f" and {said}" if found.proved else f", and the plan that was found {said}"
    if breaks := _breaks(problem, plan, found.plan, labels):
        said = f"is possible, but the plan that was found violates a condition of a level above, and {said} ({count}):"
        return WhyNot(asked, f"{what} {said}", (), found.plan, more, steps, breaks)
    return WhyNot(asked, f"{what} is possible{price} ({count}):", (), found.plan, more, steps)


def _exchanged(problem: Problem, plan: Plan, labels: Labels, soft: Sequence[SoftGoal]) -> list[str]:
    """Return phrases on the soft goals that either the plan or, according to `soft`, the present plan leaves unmet."""
    unmet = unmet_goals(replace(problem, goal={goal.fact.symbol: goal.fact.value for goal in soft}), plan)
    return [
        f"{'without' if goal.met else 'with'} the soft goal (weight {written(goal.weight)}) that {labels.fact(goal.fact)}"
        for goal in soft
        if goal.met == (goal.fact.symbol in unmet)
    ]


def _breaks(problem: Problem, plan: Plan, other: Plan, labels: Labels) -> tuple[str, ...]:
    """Return, as sentences, the conditions of levels that the plan `other` violates but the plan `plan` meets."""
    first = problem.domain.levels[0]
    if all(step.level == first for step in other.steps):
        return ()  # every level has steps
    known = {(one.change, one.conditions) for left in levels_left(problem, plan) for one in left.broken}
    found = []
    for level, one in ((left.level, one) for left in levels_left(problem, other) for one in left.broken):
        if (one.change, one.conditions) in known:
            continue
        what = f"{labels.fact(one.change)}: "
        if one.behavior is None:
            found.append(f"{what}no behaviour of level {level} brings it about")
            continue
        doing, asks = labels.grounded(one.behavior, one.arguments), map(labels.condition, one.conditions)
        found.append(f"{what}“{doing}” of level {level} requires that {' and '.join(asks)}")
    return tuple(dict.fromkeys(found))
