"""Comparison of the facts that planning derives from definitions with HermiT's entailments and with plain Python."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path
from random import Random

from confab.planner.hierarchical.operators import Program
from confab.planner.transitions import Table, key_of
from confab.planner.validation import LoggedState
from confab.reasoner.amounts import written
from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.rows import decimal
from confab.reasoner.symbols import TRUE, Symbol
from worlds.entailed import CONCLUDED, DEFINED, asserted, domain, entailed, plainly, random_state

SITUATIONS = {"liesIn": "LIES_IN", "cleanliness": "CLEANLINESS", "holds": "HOLDS", "weight": "WEIGHT"}
NAMES = {"INSIDE": "isInside", "CONTAINS": "contains", "ON_FLOOR": "onFloor", "SEES": "sees", "LINKED": "linked"}
NAMES |= {"LEADS_TO": "leadsTo", "ENDS_ON": "endsOn"}
NAMES |= {situation: kind[1:] for situation, (kind, _) in DEFINED.items()}
NAMES |= {situation: kind[1:] for situation, kind in CONCLUDED.items()}
Derived = set[tuple[str, ...]]


def first_problem() -> Problem:
    """Return the planning problem of `LOGIC`, loaded from a file, with the random state of seed 0."""
    with tempfile.TemporaryDirectory() as folder:
        said = [
            f":{one} :{prop} {other if prop == 'weight' else ':' + other} ."
            for one, prop, other in random_state(Random(0))
        ]
        path = Path(folder) / "yard.ttl"
        path.write_text("\n".join([domain(), *said]), encoding="utf-8")
        return read(load(path)).problem


def in_state(problem: Problem, facts: list[tuple[str, str, str]]) -> Problem:
    """Return the problem with another initial state."""
    relations: dict[str, frozenset[tuple[str, ...]]] = {
        name: frozenset((one, other) for one, prop, other in facts if prop == name) for name in ("partOf", "near")
    }
    initial = {}
    for one, prop, other in facts:
        if prop == "holds":
            initial[Symbol("HOLDS", (one, other))] = TRUE
        elif prop in SITUATIONS:
            value = written(decimal(other, prop)) if prop == "weight" else other
            initial[Symbol(SITUATIONS[prop], (one,))] = value
    return replace(problem, relations=relations, initial=initial)


def derived(problem: Problem) -> Iterator[tuple[str, Derived]]:
    """Yield for each evaluator its name and the facts that it derives in the initial state."""
    situations = problem.domain.situations
    defined = [
        Symbol(name, arguments)
        for name in problem.domain.rules
        for arguments in product(*(problem.classes[kind] for kind in situations[name].arguments))
    ]
    table = Table(problem.domain.situations, problem.initial)
    Program(problem).bind(table)
    facts = LoggedState(problem, problem.initial)
    yield "search", {_row(s) for s in defined if table.now[s.situation].get(key_of(s.arguments)) == TRUE}
    yield "checker", {_row(s) for s in defined if facts.value(s.situation, s.arguments) == TRUE}


def _row(symbol: Symbol) -> tuple[str, ...]:
    return NAMES[symbol.situation], *symbol.arguments


def compared(problem: Problem, seeds: range) -> tuple[Counter[str], Mapping[str, list[str]]]:
    """Return how often each definition was true in random states, and each evaluator's differences from HermiT."""
    states = [random_state(Random(seed)) for seed in seeds]
    truths = entailed([asserted(facts) for facts in states])
    true: Counter[str] = Counter()
    wrong: dict[str, list[str]] = {}
    for seed, facts, truth in zip(seeds, states, truths, strict=True):
        true.update(name for name, *_ in truth)
        for who, found in (*derived(in_state(problem, facts)), ("plain Python", plainly(facts))):
            wrong.setdefault(who, [])
            wrong[who] += [f"seed {seed}: {' '.join(row)}" for row in sorted(found ^ truth)]
    return true, wrong
