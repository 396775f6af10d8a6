"""Reading of skills from the graph: the skill of each primitive behaviour, with its roles, numbers and phases."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

import pyoxigraph as ox

from confab.reasoner.embodiment.facts import BodyFacts, EmbodimentError, grouped, rows, snake
from confab.reasoner.embodiment.values import Guard, Phase, SkillUse
from confab.reasoner.names import local_name

VARIABLES = """
SELECT DISTINCT ?behavior ?term WHERE {
  ?behavior (c:precondition|c:postcondition)/(c:condition|c:alternative|c:when)*/(c:about|c:value|c:argument2|c:witness) ?term .
  ?term a c:Variable ; :role ?role
} ORDER BY ?behavior ?term"""
MOTIONS = ("", "free", "line", "yielding", "joint", "rise", "home", "over", "drive")
FINGERS = ("", "open", "shut", "grasp")
BROUGHT = ("", "base")
CONDITIONS = ("empty", "holding", "place", "thing")
QUANTITIES = ("slip", "tilt", "height", "off", "joint", "push", "grip", "bearing", "leaning", "astray")
"""Words that phases may contain, implemented by `confab.sim.phases`, `confab.sim.touch` and `confab.sim.measuring`."""
VERDICTS = (
    "unreachable",
    "goal in collision",
    "no path",
    "tracking error",
    "object disturbed",
    "no grasp",
    "slip or drop",
    "under-pour",
    "spill",
    "toppled",
    "misplaced",
    "stuck",
    "too slow",
    "ill-defined",
    "unexpected",
)
"""Failure codes that may follow ``else`` in a guard, explained in `confab.sim.verdict.CODES`."""

GUARD = re.compile(r"(\w+) *(>=|<=) *([\w.+-]+)(?: +else +(.+))?")
TERM = re.compile(r"([+-]?)(\d*\.?\d+|[A-Za-z]\w*)")


def skill_uses(facts: BodyFacts, names: Callable[[str], str], store: ox.Store) -> dict[str, SkillUse]:
    """Return the skill of each primitive behaviour that has a skill."""
    variables = grouped(rows(store, VARIABLES))
    roles = {term: local_name(links["role"][0]) for term, links in facts.links.items() if "role" in links}
    found = {}
    for behavior in facts.ordered(node for node, links in facts.links.items() if "skill" in links):
        skill = facts.linked(behavior, "skill")[0]
        parameters = facts.ordered(facts.linked(behavior, "parameter"))
        found[names(behavior)] = SkillUse(
            names(behavior),
            local_name(skill),
            tuple(roles.get(parameter, "") for parameter in parameters),
            {local_name(term).rsplit(".", 1)[-1]: roles[term] for term in variables.get(behavior, ())},
            facts.settings(skill, behavior),
            phases(facts, skill),
            _links(facts, [*parameters, *variables.get(behavior, ())], names),
        )
    return found


def _links(facts: BodyFacts, terms: Sequence[str], names: Callable[[str], str]) -> dict[str, tuple[str, ...]]:
    """Return, for each role, the links that a term with this role can denote."""
    found = {}
    links = facts.ordered(node for node, linked in facts.links.items() if "part_of" in linked)
    for term in terms:
        kinds = set(facts.linked(term, "term_type"))
        for role in facts.linked(term, "role"):
            found[local_name(role)] = tuple(names(one) for one in links if kinds & set(facts.nearest_first(one)))
    return found


def phases(facts: BodyFacts, skill: str) -> tuple[Phase, ...]:
    """Return the phases of a skill in order; a skill that is a Python function has no phases."""
    return tuple(_phase(facts, node) for node in facts.ordered(facts.linked(skill, "phase")))


def _phase(facts: BodyFacts, node: str) -> Phase:
    def text(name: str, default: str = "") -> str:
        return facts.text(node, name, default)

    def words(name: str) -> tuple[str, ...]:
        return tuple(text(name).split())

    def sum_of(name: str, default: str = "") -> str:
        return snake(text(name, default))

    offset = sum_of("offset", "0 0 0").split()
    if len(offset) != 3:
        raise EmbodimentError(f"{node} has e:offset '{text('offset')}'; wanted three numbers or settings: x y z", node)
    found = Phase(
        local_name(node),
        text("motion"),
        text("to"),
        text("bring"),
        (offset[0], offset[1], offset[2]),
        sum_of("above", "0"),
        sum_of("value"),
        sum_of("speed", "1"),
        text("fingers"),
        sum_of("waits", "0"),
        words("touches"),
        words("when"),
        text("foreseen", "false") == "true",
        guards(node, text("until")),
        guards(node, text("check")),
        node,
        text("by", "hand"),
    )
    for what, said, known in (
        ("motion", [found.motion], MOTIONS),
        ("fingers", [found.fingers], FINGERS),
        ("bring", [found.bring], BROUGHT),
        ("when", found.when, CONDITIONS),
        ("quantity in a guard", [guard.quantity for guard in (*found.until, *found.checks)], QUANTITIES),
        ("verdict in a guard", [guard.code for guard in (*found.until, *found.checks) if guard.code], VERDICTS),
    ):
        for word in said:
            if word not in known:
                raise EmbodimentError(
                    f"{node} has an unknown {what}: '{word}'; use one of {', '.join(filter(None, known))}", node
                )
    for expression in (*found.offset, found.above, found.value, found.speed, found.wait):
        if expression != "".join(match[0] for match in TERM.finditer(expression)):
            raise EmbodimentError(
                f"{node} has '{expression}'; wanted a sum of numbers and settings, like raised-0.03", node
            )
    return found


def guards(node: str, text: str) -> tuple[Guard, ...]:
    """Parse guards in a text such as ``force >= 30; slip <= slip else slip or drop``."""
    guards = []
    for piece in (piece.strip() for piece in text.split(";")):
        match = GUARD.fullmatch(piece)
        if piece and match is None:
            raise EmbodimentError(
                f"{node} has the guard '{piece}'; wanted QUANTITY >= VALUE or QUANTITY <= VALUE, optionally else CODE",
                node,
            )
        if match is not None:
            guards.append(Guard(match[1], 1 if match[2] == ">=" else -1, snake(match[3]), match[4] or ""))
    return tuple(guards)


def evaluate(expression: str, known: Mapping[str, float]) -> float:
    """Return the value of an expression, which is a sum of numbers and of names with known values.

    >>> round(evaluate("raised-0.03", {"raised": 0.19}), 2)
    0.16
    """
    total = 0.0
    for sign, term in TERM.findall(expression):
        total += (-1.0 if sign == "-" else 1.0) * (known[term] if term in known else float(term))
    return total
