"""A domain in which a robot carries keys through doors, with binary relations and disjunctions."""

from __future__ import annotations

import random

from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Behavior,
    Parameter,
    RelationCondition,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

IN, KEY_AT, HAS, OPEN, LIT = "IN", "KEY_AT", "HAS", "OPEN", "LIT"

SITUATIONS = {
    IN: SituationType(IN, ("Robot",), "Room"),
    KEY_AT: SituationType(KEY_AT, ("Key",), "Place"),
    HAS: SituationType(HAS, ("Robot", "Key"), "Truth", boolean=True),
    OPEN: SituationType(OPEN, ("Room", "Room"), "Truth", boolean=True),
    LIT: SituationType(LIT, ("Room",), "Truth", boolean=True),
}

GO = Behavior(
    "GO",
    1,
    (Parameter("?robot", "Robot"), Parameter("?to", "Room")),
    (Parameter("?from", "Room"),),
    (
        ValueCondition(IN, ("?robot",), "?from"),
        AnyOf(
            (
                (RelationCondition("hall", ("?from", "?to")),),
                (RelationCondition("door", ("?from", "?to")), ValueCondition(OPEN, ("?from", "?to"), TRUE)),
            )
        ),
    ),
    (ValueEffect(IN, ("?robot",), "?to"),),
)
UNLOCK = Behavior(
    "UNLOCK",
    1,
    (Parameter("?robot", "Robot"), Parameter("?from", "Room"), Parameter("?to", "Room")),
    (),
    (
        RelationCondition("door", ("?from", "?to")),
        ValueCondition(IN, ("?robot",), "?from"),
        Witness(
            "?key",
            "Key",
            (RelationCondition("fits", ("?key", "?from", "?to")), ValueCondition(HAS, ("?robot", "?key"), TRUE)),
        ),
    ),
    (ValueEffect(OPEN, ("?from", "?to"), TRUE), ValueEffect(OPEN, ("?to", "?from"), TRUE)),
)
TAKE = Behavior(
    "TAKE",
    1,
    (Parameter("?robot", "Robot"), Parameter("?key", "Key")),
    (Parameter("?room", "Room"),),
    (
        ValueCondition(IN, ("?robot",), "?room"),
        ValueCondition(KEY_AT, ("?key",), "?room"),
        Witness("?other", "Key", (ValueCondition(HAS, ("?robot", "?other"), TRUE),), negated=True),
    ),
    (ValueEffect(HAS, ("?robot", "?key"), TRUE), ValueEffect(KEY_AT, ("?key",), "carried")),
)
DROP = Behavior(
    "DROP",
    1,
    (Parameter("?robot", "Robot"), Parameter("?key", "Key")),
    (Parameter("?room", "Room"),),
    (ValueCondition(HAS, ("?robot", "?key"), TRUE), ValueCondition(IN, ("?robot",), "?room")),
    (ValueEffect(HAS, ("?robot", "?key"), FALSE), ValueEffect(KEY_AT, ("?key",), "?room")),
)
SWITCH = Behavior(
    "SWITCH",
    1,
    (Parameter("?robot", "Robot"),),
    (Parameter("?room", "Room"),),
    (ValueCondition(IN, ("?robot",), "?room"),),
    (
        ValueEffect(LIT, ("?room",), TRUE, when=(ValueCondition(LIT, ("?room",), TRUE, negated=True),)),
        ValueEffect(LIT, ("?room",), FALSE, when=(ValueCondition(LIT, ("?room",), TRUE),)),
    ),
)


def rooms(count: int, seed: int) -> Problem:
    """Return a random problem of a building with a tree of rooms, locked doors, keys and lights."""
    rng = random.Random(seed)
    names = [f"room{i + 1}" for i in range(count)]
    halls: set[tuple[str, ...]] = set()
    doors: list[tuple[str, str]] = []
    for i in range(1, count):
        other = names[rng.randrange(i)]
        if rng.random() < 0.5:
            halls |= {(names[i], other), (other, names[i])}
        else:
            doors.append((names[i], other))
    keys = [f"key{i + 1}" for i in range(len(doors))]
    fits = {(k, *pair) for k, (a, b) in zip(keys, doors, strict=True) for pair in ((a, b), (b, a))}
    at = {k: rng.choice(names[: 2 + i]) for i, k in enumerate(keys)}
    initial = {Symbol(IN, ("robot",)): "room1"} | {Symbol(KEY_AT, (k,)): r for k, r in at.items()}
    goal = {Symbol(LIT, (room,)): TRUE for room in rng.sample(names, 2)}
    goal[Symbol(IN, ("robot",))] = rng.choice(names)
    if keys:
        goal[Symbol(KEY_AT, (rng.choice(keys),))] = rng.choice(names)
    return Problem(
        "rooms",
        Domain(SITUATIONS, {b.name: b for b in (GO, UNLOCK, TAKE, DROP, SWITCH)}),
        {
            "Robot": ("robot",),
            "Room": tuple(names),
            "Key": tuple(keys),
            "Place": (*names, "carried"),
            "Truth": (FALSE, TRUE),
        },
        {
            "hall": frozenset(halls),
            "door": frozenset(pair for a, b in doors for pair in ((a, b), (b, a))),
            "fits": frozenset(fits),
        },
        initial,
        goal,
    )
