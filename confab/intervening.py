"""Interventions in the notation of the command line, such as ``after=28 cup2 LOCATION location8``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from confab.accepting import possible
from confab.planner.acting.episode import Intervention, InterventionKind
from confab.planner.acting.symbolic_world import place_symbols, with_individual
from confab.reasoner.derivation import TASK
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import nearest
from confab.reasoner.possible import PLACE, refuse_derived, refuse_impossible
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import parse_fact
from confab.reasoner.symbols import Fact, Symbol

FORMS = (
    "'after=28 cup2 LOCATION location8', 'after=28 goal FACT', 'after=28 drop-goal cup2 LOCATION', 'after=28 remove cup2', "
    "'after=28 add Cup cup9 FACT', 'after=28 knock cup2', 'after=28 push cup2 6 -3' (cm), 'after=28 box location7 [6x6x12]' (cm), "
    "with after=ID, after=PATH (0.1.2), after=NAME (L2#0) or at=SECONDS"
)


def parse_interventions(problem: Problem, texts: Iterable[str]) -> list[Intervention]:
    """Return the interventions that texts describe.

    A text may also name a file with one intervention per line (a ``#`` at the beginning of a line or after a space begins a
    comment). An intervention may mention an individual that an intervention before it adds.

    Raises
    ------
    KnowledgeError
        A text has no known form, or mentions terms that the scene doesn't have.
    """
    found: list[Intervention] = []
    for text in texts:
        lines = [text]
        if "=" not in text:
            path = Path(text)
            if not path.is_file():
                raise KnowledgeError(f"'{text}' is no intervention and no file; wanted {FORMS}")
            try:
                content = path.read_text(encoding="utf-8")
                lines = [re.split(r"(?:^|\s)#", line)[0].strip() for line in content.splitlines()]
            except UnicodeDecodeError as error:
                raise KnowledgeError(f"{path}: not UTF-8 text ({error}); wanted one intervention per line") from error
        for line in filter(None, lines):
            found.append(parse_intervention(problem, line))
            if found[-1].change is InterventionKind.ADD:
                problem = _widened(problem, found[-1])
    return found


def parse_intervention(problem: Problem, text: str) -> Intervention:
    """Return the intervention that a text describes.

    Raises
    ------
    KnowledgeError
        The text has no known form, or mentions terms that the scene doesn't have.
    """
    match = re.fullmatch(r"\s*(after|at)=(\S+)\s+(.+?)\s*", text)
    if match is None:
        raise KnowledgeError(f"'{text}' is no intervention; wanted {FORMS}")
    when: dict[str, Any] = {"text": text.strip()}
    try:
        if match[1] == "at":
            when["at"] = _seconds(match[2])
        else:
            when["after"] = _step_of(match[2], problem.domain.levels)
    except ValueError as error:
        first, last = problem.domain.levels[0], problem.domain.levels[-1]
        raise KnowledgeError(
            f"'{match[1]}={match[2]}' in '{text}': wanted an ID, a path like 0.1.2 or a name from L{first}#0 to L{last}#… "
            "for after, seconds from 0 on for at"
        ) from error
    verb, _, rest = match[3].partition(" ")
    words = rest.split()
    if verb in problem.individuals and words[:1] and words[0] in problem.domain.situations:
        verb = ""  # an individual with the name of a verb, in a fact
    if verb == "goal":
        if not words:
            raise KnowledgeError(f"'{text}': wanted 'goal object SITUATION value'")
        return Intervention(InterventionKind.GOAL, (Fact(*parse_fact(problem, rest)),), **when)
    if verb == "drop-goal":
        return Intervention(InterventionKind.DROP_GOAL, symbol=_symbol(problem, words, text), **when)
    if verb in ("remove", "knock"):
        if len(words) != 1:
            raise KnowledgeError(f"'{text}': wanted '{verb} OBJECT', one object; got {len(words)}")
        return Intervention(InterventionKind(verb), individual=_placed(problem, words[0], text, verb), **when)
    if verb == "push":
        return _push(problem, words, text, when)
    if verb == "box":
        return _box(problem, words, text, when)
    if verb == "add":
        return _add(problem, words, text, when)
    fact = Fact(*parse_fact(problem, match[3]))
    with possible():
        refuse_derived(problem.domain, [fact], f"'{text}'")
        refuse_impossible(problem, {}, {fact.symbol: fact.value}, f"'{text}'")
    return Intervention(InterventionKind.WORLD, (fact,), **when)


def _step_of(text: str, levels: Sequence[int]) -> int | tuple[int, ...] | str:
    """Return the ID, the path or the name of a step; raise ValueError if the text is none of these."""
    if named := re.fullmatch(r"[lL](\d+)#(\d+)", text):
        level, position = map(int, named.groups())
        if level not in levels:
            raise ValueError(text)
        return f"L{level}#{position}"
    if not re.fullmatch(r"\d+(\.\d+)*", text):
        raise ValueError(text)
    path = tuple(map(int, text.split(".")))
    return path if len(path) > 1 else path[0]


def _seconds(text: str) -> float:
    """Convert a text to a time in seconds; raise ValueError if the time is negative or infinite."""
    seconds = float(text)
    if not 0 <= seconds < math.inf:
        raise ValueError(text)
    return seconds


def _symbol(problem: Problem, words: list[str], text: str) -> Symbol:
    if len(words) < 2:
        raise KnowledgeError(f"'{text}': wanted 'drop-goal object SITUATION'")
    symbol = Symbol(words[1], (words[0], *words[2:]))
    known = {str(s): s for s in (*problem.initial, *problem.goal)}
    if str(symbol) not in known:
        raise KnowledgeError(f"'{text}': there is no {symbol}{nearest(str(symbol), known)}")
    return symbol


def _known(problem: Problem, individual: str, text: str) -> str:
    kinds = {kind for situation in problem.domain.situations.values() for kind in situation.arguments} - {TASK}
    individuals = {name for kind in kinds for name in problem.members(kind)}
    if individual not in individuals:
        raise KnowledgeError(f"'{text}': no object '{individual}'{nearest(individual, individuals)}")
    return individual


def _placed(problem: Problem, individual: str, text: str, verb: str) -> str:
    """Return the name of an object that is to be knocked over or pushed; raise `KnowledgeError` if no fact states its place."""
    _known(problem, individual, text)
    if verb != "remove" and not any(symbol in problem.initial for symbol in place_symbols(problem, individual)):
        raise KnowledgeError(f"'{text}': {individual} is no object that stands at a place which physics perceives")
    return individual


def _push(problem: Problem, words: list[str], text: str, when: dict[str, Any]) -> Intervention:
    """Return the push of an object, read from ``OBJECT X Y``: the centimetres away from the robot and to the robot's left."""
    try:
        individual, *by = words
        numbers = tuple(float(number) / 100 for number in by)
    except ValueError:
        numbers = ()
    if len(numbers) != 2 or not all(map(math.isfinite, numbers)) or not any(numbers):
        raise KnowledgeError(f"'{text}': wanted 'push OBJECT X Y', centimetres away from the robot and to its left")
    return Intervention(
        InterventionKind.PUSH, individual=_placed(problem, individual, text, "push"), numbers=numbers, **when
    )


def _box(problem: Problem, words: list[str], text: str, when: dict[str, Any]) -> Intervention:
    """Return the intervention that puts a box at a place, read from ``PLACE [WIDTHxDEPTHxHEIGHT]`` in centimetres."""
    place, size = (*words, "6x6x12")[:2] if words else ("", "")
    try:
        numbers = tuple(float(number) / 100 for number in size.split("x"))
    except ValueError:
        numbers = ()
    if len(words) not in (1, 2) or len(numbers) != 3 or not all(0.01 <= number <= 1 for number in numbers):
        raise KnowledgeError(f"'{text}': wanted 'box PLACE', or 'box PLACE 6x6x12' with centimetres from 1 to 100")
    situations = [s for s in problem.domain.situations.values() if s.perceived is not None and s.perceived.by == PLACE]
    wheres = [s for s in situations if len(s.arguments) == 1 and place in problem.members(s.range)]
    if not wheres:
        known = [one for s in situations for one in problem.members(s.range)]
        raise KnowledgeError(f"'{text}': no place '{place}' at which physics perceives objects{nearest(place, known)}")
    name, number = "box1", 1
    while name in problem.individuals:
        number += 1
        name = f"box{number}"
    fact = Fact(Symbol(wheres[0].name, (name,)), place)
    return Intervention(
        InterventionKind.BOX, (fact,), individual=name, kind=wheres[0].arguments[0], numbers=numbers, **when
    )


def _widened(problem: Problem, added: Intervention) -> Problem:
    """Return the problem with the individual that an intervention adds, and with the facts of this individual."""
    initial = {**problem.initial, **{fact.symbol: fact.value for fact in added.facts}}
    return replace(with_individual(problem, added.individual, added.kind), initial=initial)


def _add(problem: Problem, words: list[str], text: str, when: dict[str, Any]) -> Intervention:
    """Return the intervention that adds an individual with facts, read from words like ``Cup cup9 LOCATION location5``."""
    if len(words) < 4 or len(words) % 2:
        raise KnowledgeError(f"'{text}': wanted 'add CLASS NAME SITUATION value …'")
    kind, individual, *pairs = words
    if kind not in problem.classes:
        raise KnowledgeError(f"'{text}': unknown class '{kind}'{nearest(kind, problem.classes)}")
    if any(individual in members for members in problem.classes.values()):
        raise KnowledgeError(f"'{text}': there is a '{individual}' already; take another name")
    wider = with_individual(problem, individual, kind)
    facts = [
        Fact(*parse_fact(wider, f"{individual} {situation} {value}"))
        for situation, value in zip(pairs[::2], pairs[1::2], strict=True)
    ]
    with possible():
        refuse_impossible(wider, {}, {fact.symbol: fact.value for fact in facts}, f"'{text}'")
    return Intervention(InterventionKind.ADD, tuple(facts), individual=individual, kind=kind, **when)
