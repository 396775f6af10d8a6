"""Controls on the page for changes of facts, goals and interventions, and the plans that result from these changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypedDict

from confab.accepting import check_goal, possible, shipped_queries
from confab.known import Known
from confab.labels import Labels, labels_of
from confab.page.data import page_data
from confab.page.results import called
from confab.page.schema import PageData, ReadyQuery, Turnable, TurnableRow
from confab.planner.plan import Limits
from confab.planner.solve import DEFAULT_MODE, Request, solve
from confab.planning import Result
from confab.reasoner.aggregates.totals import following
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import LimitError
from confab.reasoner.names import nearest
from confab.reasoner.possible import refuse_derived, refuse_impossible
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Fact, Symbol

if TYPE_CHECKING:
    from confab.execution import Execution
    from confab.reasoner.graph.knowledge import KnowledgeGraph

MOST_SYMBOLS = 20_000
"""Maximum number of symbols that the user can change on the page. For a scene with more symbols, the page states only their
number.
"""
SECONDS = 10.0
"""Time limit of planning for the page in seconds."""


class TurnedIntervention(TypedDict):
    """An intervention from the page: the ID of the step before it, its kind (world or goal), the symbol and the new value."""

    after: str | int
    what: str
    key: str
    value: str


class Turned(TypedDict, total=False):
    """The values of facts and goals that a user has changed on the page; a key has the words of the symbol.

    The value None removes a goal.
    """

    facts: dict[str, str]
    goals: dict[str, str | None]
    interventions: list[TurnedIntervention]


@dataclass(frozen=True)
class Sheet:
    """A scene with changes of its facts, goals and interventions, and the resulting plans and executions.

    Examples
    --------
    >>> import confab
    >>> sheet = Sheet(confab.load("beverage-serving"))
    >>> sheet.answer({"facts": {"cup1 LOCATION": "location7"}})["headline"].split(",")[0]
    'solved: 3 / 8 / 26 steps per level'
    """

    scene: Known

    @cached_property
    def problem(self) -> Problem:
        """The problem of the whole scene."""
        return self.scene.problem

    @cached_property
    def labels(self) -> Labels:
        """The labels of the problem's terms."""
        return labels_of(self.scene.knowledge, self.scene.names, self.problem)

    @cached_property
    def symbols(self) -> dict[str, Symbol]:
        """The symbols by their words, such as ``cup1 LOCATION``; symbols of goals come first."""
        goal = self.problem.goal
        those = sorted({*self.problem.initial, *goal}, key=lambda s: (s not in goal, s.arguments, s.situation))
        return {" ".join((*s.arguments[:1], s.situation, *s.arguments[1:])): s for s in those}

    def turnable(self) -> Turnable:
        """Return the symbols that the user can change, and the lists of their possible values."""
        rows: list[TurnableRow] = []
        lists: dict[str, list[str]] = {}
        for key, symbol in list(self.symbols.items())[:MOST_SYMBOLS]:
            values, kind = self._values(symbol), self.problem.domain.situations[symbol.situation].range
            name = kind if lists.setdefault(kind, values) == values else key  # a separate list if the values differ
            lists.setdefault(name, values)
            rows.append(
                {
                    "key": key,
                    "label": self.labels.about(symbol),
                    "values": name,
                    "now": self.problem.initial.get(symbol, FALSE),
                    "wanted": self.problem.goal.get(symbol),
                }
            )
        named = {name: [(value, self.labels.name(value)) for value in values] for name, values in lists.items()}
        return {"rows": rows, "values": named, "hidden": max(0, len(self.symbols) - MOST_SYMBOLS)}

    def _values(self, symbol: Symbol) -> list[str]:
        situation = self.problem.domain.situations[symbol.situation]
        values = [TRUE, FALSE] if situation.boolean else list(self.problem.classes.get(situation.range, ()))
        there = (self.problem.initial.get(symbol), self.problem.goal.get(symbol), situation.rest)
        return [*values, *dict.fromkeys(v for v in there if v is not None and v not in values)]

    def turned(self, by: Turned) -> Problem:
        """Return the problem with changed facts and goals.

        Raises
        ------
        KnowledgeError
            A symbol doesn't exist, a value is invalid, or the facts are inconsistent.
        """
        symbols = self.symbols
        for key in (*by.get("facts", {}), *by.get("goals", {})):
            if key not in symbols:
                raise KnowledgeError(f"there is no {key}{nearest(key, symbols)}")
        initial, goal = dict(self.problem.initial), dict(self.problem.goal)
        for key, value in by.get("facts", {}).items():
            initial[symbols[key]] = self._checked(key, value)
        initial = following(self.problem, initial)
        for key, wanted in by.get("goals", {}).items():
            goal.pop(symbols[key], None)
            if wanted is not None:
                goal[symbols[key]] = wanted
        with possible():
            facts = by.get("facts", {}).items()
            refuse_derived(self.problem.domain, [Fact(symbols[key], value) for key, value in facts])
            refuse_impossible(self.problem, self.problem.initial, initial)
        turned = replace(self.problem, initial=initial, goal=goal)
        if goal or not by.get("goals"):
            check_goal(self.scene.iri, turned)
        return turned

    def _checked(self, key: str, value: object) -> str:
        """Return a value of a symbol; raise `KnowledgeError` if the value is invalid. For an amount, any text is a value."""
        symbol = self.symbols[key]
        situation = self.problem.domain.situations[symbol.situation]
        known = self._values(symbol)
        if not isinstance(value, str) or (situation.quantity is None and value not in known):
            raise KnowledgeError(f"{key} can't be {value}{nearest(str(value), known)}")
        return value

    def plan(self, by: Turned) -> Result:
        """Plan with the changed facts and goals, and return the result."""
        problem = self.turned(by)
        return Result(self.scene, problem, solve(Request(problem, DEFAULT_MODE, Limits(seconds=SECONDS))), {})

    def act(self, by: Turned, result: Result) -> Execution | None:
        """Execute the plan of a result with the interventions; return None if there is no plan or no intervention."""
        from confab.execution import execute

        if not by.get("interventions") or not result.solved:
            return None
        texts = [self.intervention(each) for each in by["interventions"]]
        return execute(self.scene, result.problem, result.plan, texts)

    @staticmethod
    def intervention(turned: TurnedIntervention) -> str:
        """Return an intervention from the page in the notation of the command line.

        Examples
        --------
        >>> Sheet.intervention({"after": 28, "key": "cup2 LOCATION", "value": "location8", "what": "goal"})
        'after=28 goal cup2 LOCATION location8'
        """
        goal = "goal " if turned["what"] == "goal" else ""
        return f"after={turned['after']} {goal}{turned['key']} {turned['value']}"

    @cached_property
    def scene_data(self) -> PageData:
        """The content of the page before planning, with controls and queries."""
        data = page_data(self.scene)
        data["turnable"], data["queries"] = self.turnable(), ready_queries(self.scene.knowledge)
        return data

    def answer(self, by: Turned) -> PageData:
        """Return the content of the page after a change of controls. If planning fails, the content is only the reason."""
        try:
            result = self.plan(by)
            execution = self.act(by, result)
        except (KnowledgeError, LimitError) as error:
            return {"problem": str(error)}
        return page_data(self.scene, result, execution=execution, again=self._again(by))

    def _again(self, by: Turned) -> str:
        """Return the command or the Python code that reproduces the result."""
        name = called(self.scene)
        facts = [f"{key} {value}" for key, value in by.get("facts", {}).items()]
        goals = [f"{key} {value}" for key, value in by.get("goals", {}).items() if value is not None]
        dropped = [key for key, value in by.get("goals", {}).items() if value is None]
        people = [self.intervention(each) for each in by.get("interventions", [])]
        if not (facts or goals or dropped or people):
            return f"confab plan {name}"
        changes = _called("with_fact", facts) + _called("without_goal", dropped) + _called("with_goal", goals)
        then = f"scene.execute(interventions={people!r})" if people else "scene.plan()"
        return f"scene = confab.load({name!r}){changes}\n{then}"


def _called(method: str, facts: Sequence[str]) -> str:
    return f".{method}({', '.join(map(repr, facts))})" if facts else ""


def ready_queries(graph: KnowledgeGraph) -> list[ReadyQuery]:
    """Return the shipped queries that apply to a scene, in the order of their names."""
    found: list[ReadyQuery] = []
    for name, whole in shipped_queries(graph, episodes=False).items():
        lines = whole.splitlines()
        question = next((line.partition(":")[2].strip() for line in lines if line.startswith("# Question:")), name)
        text = "\n".join(line for line in lines if not line.startswith("#"))
        found.append({"name": name, "question": question, "text": text.strip()})
    return found


def turned_from(data: object) -> Turned:
    """Return the changed controls from the JSON data that the page sends.

    Raises
    ------
    KnowledgeError
        The data have another form.
    """
    wanted = "wanted an object with facts, goals and interventions"
    if not isinstance(data, Mapping):
        raise KnowledgeError(f"got {type(data).__name__}; {wanted}")
    if unknown := sorted(data.keys() - {"facts", "goals", "interventions"}):
        raise KnowledgeError(f"got {', '.join(map(str, unknown))[:80]!r}; {wanted}")
    facts, goals, people = data.get("facts", {}), data.get("goals", {}), data.get("interventions", [])
    if not isinstance(facts, Mapping) or not isinstance(goals, Mapping) or not isinstance(people, list):
        raise KnowledgeError(f"facts or goals are no object, or interventions no list; {wanted}")
    if not all(isinstance(value, str) for value in facts.values()):
        raise KnowledgeError("the value of a fact is no text")
    if not all(value is None or isinstance(value, str) for value in goals.values()):
        raise KnowledgeError("the value of a goal is neither text nor null")
    fields = ("after", "what", "key", "value")
    if not all(isinstance(one, Mapping) and all(isinstance(one.get(f), str | int) for f in fields) for one in people):
        raise KnowledgeError(f"an intervention has no text for one of {', '.join(fields)}")
    interventions: list[TurnedIntervention] = [
        {"after": one["after"], "what": str(one["what"]), "key": str(one["key"]), "value": str(one["value"])}
        for one in people
    ]
    return {"facts": dict(facts), "goals": dict(goals), "interventions": interventions}
