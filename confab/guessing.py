"""The name that does what a wrong name asks for, found by its words among the public names and their descriptions.

A wrong name is split into words; words of one meaning are equal. The candidates are the names of the object itself, then those of
the objects that it leads to (``result.outcome.search``), then all others (``scene.with_fact``).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from difflib import SequenceMatcher
from functools import cache
from importlib import import_module

CLASSES = {
    "scene": "confab.scene.Scene",
    "result": "confab.planning.Result",
    "plan": "confab.planner.plan.Plan",
    "step": "confab.planner.plan.Step",
    "outcome": "confab.planner.plan.Outcome",
    "timed": "confab.planner.timed.plan.TimedPlan",
    "labels": "confab.labels.Labels",
    "report": "confab.physics.Report",
    "execution": "confab.execution.Execution",
    "episode": "confab.planner.acting.episode.Episode",
    "table": "confab.table.Table",
    "memory": "confab.memory.Memory",
    "problem": "confab.reasoner.symbols.Problem",
    "domain": "confab.reasoner.symbols.Domain",
}
WAYS: Mapping[str, Mapping[str, str]] = {
    "confab": {"scene": "load(SCENE)"},
    "scene": {"result": "plan()", "report": "verify()", "execution": "execute()", "problem": "problem"},
    "result": {"plan": "plan", "outcome": "outcome", "timed": "timed", "labels": "labels"},
    "execution": {"episode": "episode"},
    "problem": {"domain": "domain"},
}
"""The attribute, or the call, that leads from a thing to another one."""
MEANINGS = """
load open read parse import file ontology problem domain scene ttl
scenes examples datasets catalog list available domains
families generate random
plan solve policy planner planning replan find
query ask sparql select
verify simulate simulation simulator physics rollout monte carlo test
execute run act perform dispatch apply step through
validate lint check shacl consistent
facts fact state init initial values now
goals goal task tasks objective
objects object individuals individual instances things entities
behaviors behavior behaviours behaviour action actions operator operators skills schema schemas preconditions effects
situations predicates fluents situation
arguments args params parameters objects
steps actions children subplan subplans sub refinement decomposition sequence list
primitives leaves low
cost metric price
seconds time timeout runtime duration elapsed
search expanded expansions statistics stats nodes generated
reason why because unsolvable failure error explain justify
report html page visualise visualize visualization render plot
picture draw show plot render image png map visualise visualize
video film movie gif mp4 animation
graph triples rdf turtle ttl serialize serialise save add
save store write dump persist
json dict
dataframe df pandas to_dataframe
records dict dicts
rows head values tail
length levels num number count size depth shape
solved success succeeded ok solvable done found
outcome status
bound optimal lower
timed schedule makespan duration timeline gantt
certificate proof
events timeline observations history log trace
replans repairs changes replanning
failures failure errors faults
memory experience learn learned train fit forget
advice rules rule weights
embodiment robot robots arms body
iri uri namespace namespaces prefixes base
with_fact fact set assert tell put remove without change
with_goal goal set
rate accuracy probability score
label words text sentence
__version__ version
"""
"""Words with one meaning, a line each."""
FILLERS = frozenset(
    {"get", "to", "as", "is", "has", "all", "n", "of", "the", "for", "in", "make", "create", "new", "my", "with"}
)
OF_ANY = frozenset({"plan", "planning", "search"})
"""Words that say little beside others: the length of a plan is its length."""
ENOUGH, FAR = 0.55, 0.1
"""Least score of a name that is told; by how much a name counts less for each step that leads to it."""


@cache
def meanings() -> Mapping[str, frozenset[int]]:
    """Return the lines of `MEANINGS` that a word is in."""
    lines = [line.split() for line in MEANINGS.strip().splitlines()]
    words = {word for line in lines for word in line}
    return {word: frozenset(i for i, line in enumerate(lines) if word in line) for word in words}


def alike(one: str, other: str) -> float:
    """Return how much two words mean the same, from 0 to 1."""
    if one.rstrip("s") == other.rstrip("s"):
        return 1.0
    if meanings().get(one, frozenset()) & meanings().get(other, frozenset()):
        return 0.9
    near = SequenceMatcher(None, one, other).ratio()
    return near if near > 0.8 and min(len(one), len(other)) > 3 else 0.0


@cache
def words_of(name: str) -> tuple[str, ...]:
    """Return the words of a name that say something: of ``getPlanLength`` these are ``plan`` and ``length``."""
    words = tuple(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().strip("_").split("_"))
    return tuple(word for word in words if word not in FILLERS) or words


@cache
def described(kind: str) -> Mapping[str, str]:
    """Return the public names of a class, or of the module `confab`, each with the first line of its description."""
    if kind == "confab":
        module = import_module("confab")
        names = ["Memory", *(n for n in module.__all__ if n.islower())]  # of classes only a memory is made by hand
        return {**{n: (getattr(module, n).__doc__ or "").split("\n")[0] for n in names}, "__version__": ""}
    home, _, name = CLASSES[kind].rpartition(".")
    cls = getattr(import_module(home), name)
    named = {field.name for field in fields(cls)} if is_dataclass(cls) else set[str]()
    found = {n for n in {*dir(cls), *named} if not n.startswith("_")}
    docs = {n: getattr(getattr(cls, n, None), "__doc__", None) or "" for n in found}
    return {n: "" if n in named else doc.strip().split("\n")[0] for n, doc in docs.items()}


def places(kind: str) -> Iterator[tuple[str, str, int]]:
    """Yield each class that can be looked at, with what stands before its names, and the number of steps there."""
    waiting, seen = [(kind, "confab." if kind == "confab" else "", 0)], {kind}
    while waiting:
        here, before, far = waiting.pop(0)
        yield here, before, far
        for there, way in WAYS.get(here, {}).items():
            if there not in seen:
                seen.add(there)
                waiting.append((there, f"{before}{way}.", far + 1))
    for there in ("confab", "scene", "result", "plan", "memory"):
        if there not in seen:
            yield there, f"{there}.", 3


def score(wanted: tuple[str, ...], name: str, doc: str) -> float:
    """Return how well a name does what some words ask for, from 0 to 1."""
    has, said = words_of(name), set(re.findall(r"[a-z]+", doc.lower()))
    met = [max(alike(word, one) for one in has) for word in wanted]
    told = [
        max(known, 0.6 * max((alike(word, one) for one in said), default=0.0))
        for word, known in zip(wanted, met, strict=True)
    ]
    extra = sum(max(alike(word, one) for word in wanted) == 0 for one in has)
    return sum(told) / len(told) - 0.12 * extra


def guessed(kind: str, name: str) -> str:
    """Return the name that does what a wrong name of a thing asks for, or an empty text.

    >>> guessed("result", "planning_time"), guessed("plan", "save"), guessed("plan", "xyzzy")
    ('seconds', 'result.save', '')
    """
    wanted = words_of(name)
    wanted = tuple(word for word in wanted if alike(word, kind) < 1 and word not in OF_ANY) or wanted
    best = (ENOUGH, "")
    for there, before, far in places(kind):
        for known, doc in sorted(described(there).items(), key=lambda one: (len(one[0]), one[0])):
            worth = score(wanted, known, doc) - FAR * far
            best = max(best, (worth, before + known), key=lambda one: one[0])
    return best[1]


def chosen(name: str, known: Iterable[str]) -> str:
    """Return which of some names a wrong one means, or an empty text.

    >>> chosen("timeout", ["goals", "time_limit"]), chosen("seed", ["goals", "time_limit"])
    ('time_limit', '')
    """
    worth = {each: score(words_of(name), each, "") for each in known}
    best = max(worth, key=lambda each: worth[each], default="")
    return best if worth.get(best, 0.0) >= ENOUGH else ""
