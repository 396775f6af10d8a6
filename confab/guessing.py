"""The hint in the error about a wrong name.

A wrong name is understood with certainty if the tables of `confab.hints` have it, or a name with the same words, for its kind of
object or for an object that this object leads to, or if it is a typing error. Then the hint is the right name alone.

For any other name, the hint is an overview of the object by purpose. The most likely name precedes the overview: a name of another
library's object that the object is converted to (``plan.to_dataframe()``), or a name in the tables with enough of the words.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from difflib import get_close_matches
from functools import cache
from importlib import import_module

from confab.hints import COMMANDS, HINTS, NEEDLESS, OPTIONS, OVERVIEW, WORDS

FORMS: Mapping[str, Mapping[str, str]] = {
    "scene": {
        "graph": "rdflib.Graph",
        "owl": "owlready2.World",
        "to_unified_planning()": "unified_planning.model.Problem",
    },
    "result": {"plan.to_dataframe()": "pandas.DataFrame"},
    "plan": {"to_dataframe()": "pandas.DataFrame", "to_networkx()": "networkx.DiGraph"},
    "execution": {"graph()": "networkx.DiGraph"},
    "table": {"dataframe()": "pandas.DataFrame"},
    "memory": {"table().dataframe()": "pandas.DataFrame"},
}
"""The attributes and calls that return an object of another library, each with the object's class."""
WAYS: Mapping[str, Mapping[str, str]] = {
    "confab": {"scene": "scene"},
    "scene": {"plan()": "result", "execute()": "execution", "problem": "problem"},
    "result": {"plan": "plan", "outcome": "outcome", "timed": "schedule"},
    "plan": {"result": "result"},
    "step": {"scene.behaviors[step.behavior]": "behaviour"},
    "execution": {"episode": "episode", "plan": "plan"},
    "problem": {"domain": "domain"},
}
"""The expressions for other objects to which an object leads, each with the kind of the other object."""
COMMON = {"copy.deepcopy({})": "deepcopy", "print({})": "print", "{} == other": "=="}
"""Expressions for every kind of object, each with the index of its other names in `WORDS`."""
WHOLE = re.compile(r"(confab|copy|execution|from|help|len|memory|print|result|scene|step|str)\b|\W|__|\w+\[")
"""The beginning of an expression that doesn't begin with an attribute of the object."""
FILLERS = {*re.findall(r"\w+", "get to as is has all n of the for in create new my with from what on was do does list")}
"""Words that are ignored if a name has other words."""
ASIDE = {"confab": ("scene", "ontology", "file")}
"""Further words that are ignored if a name of a kind of object has other words; the name of the kind is always ignored."""
SHORT = 3
"""Maximum length of the words of tables that aren't looked for inside other words."""
TYPED = 0.85
"""Minimum similarity to a known name for a wrong name to be treated as a typing error."""
PART, OWN, UNKNOWN, HALF = 0.6, 0.1, 0.4, 0.75
"""Share of the weight of a matching word that is a part of a longer name, bonus of a word of the right name itself, weight of a
word that no entry has, and factor for an entry in which all matching words are parts of longer names."""
USUAL = 0.5
"""Minimum share of the weight of the words of a wrong name for an entry to be suggested; rare words weigh more."""


@cache
def stem(word: str) -> str:
    """Return the stem of a word, for example ``simulat`` for ``simulators``."""
    singular = re.sub(r"(?<=[^s])s$", "", re.sub(r"ies$", "y", word))
    return re.sub(r"(?<=\w{5})(ation|ing|ion|er|or|ed|ful|e)$", "", singular)


@cache
def known_words() -> frozenset[str]:
    """Return the stems of the longer words in the tables."""
    names = (name for table in (WORDS, *HINTS.values()) for text in table.values() for name in text.split())
    return frozenset(stem(word) for name in names for word in parted(name).split("_") if len(word) > SHORT)


def segments(run: str) -> tuple[str, ...]:
    """Split a text without separators into known words; return an empty tuple if this is impossible.

    >>> segments("simulateplan"), segments("xyzzy")
    (('simulate', 'plan'), ())
    """
    if stem(run) in known_words() or run in FILLERS:
        return (run,)
    for end in range(len(run) - 2, 2, -1):
        if (stem(run[:end]) in known_words() or run[:end] in FILLERS) and (rest := segments(run[end:])):
            return (run[:end], *rest)
    return ()


def parted(name: str) -> str:
    """Return a name in lower case with underscores between its words, for example ``get_plan`` for ``getPlan``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


@cache
def words_of(name: str, kind: str = "") -> frozenset[str]:
    """Return the stems of the significant words of a name, for example of ``plan`` and ``length`` for ``getPlanLength``."""
    words = [word for run in re.findall(r"[^\W_]+", parted(name)) for word in segments(run) or (run,)]
    aside = {*map(stem, (kind, *ASIDE.get(kind, ())))}
    telling = frozenset(
        stem(word) for word in words if word not in FILLERS and stem(word) not in aside and len(word) > 1
    )
    return telling or frozenset(map(stem, words))


@cache
def groups(kind: str) -> Mapping[str, list[str]]:
    """Return the expressions in the overview of a kind of object, by purpose.

    >>> groups("symbol")
    {'to read': ['situation', 'arguments'], 'to ask': ['scene.facts']}
    """
    parts = (part.partition(": ") for part in OVERVIEW.get(kind, "").split("; ") if part)
    return {purpose: re.split(r", (?![^()]*\))", text) for purpose, _, text in parts}


def last_name(expression: str) -> str:
    """Return the last name of an expression, for example ``primitives`` for ``plan.primitives``; empty if there is none."""
    found = re.search(r"(?:^|\.)(\w+)(?:\([^()]*\))?$", expression)
    return found[1] if found else ""


def pairs(table: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return each name in a table with its index, which is what to use."""
    return [(name, right) for right, names in table.items() for name in names.split()]


@cache
def listed(kind: str) -> list[tuple[str, str]]:
    """Return the known names for a kind of object, each with the expression to use; names of `HINTS` are first."""
    own = [item for purpose, group in groups(kind).items() if (kind, purpose) != ("confab", "also") for item in group]
    shown = [item for item in own if item not in groups(kind).get("also", ())]
    first = {last_name(item): item for item in reversed(shown)}
    shared = {item: WORDS.get(last_name(item), "") for item in shown if item in first.values()}
    common = {form.format(kind): WORDS[index] for form, index in COMMON.items() if kind != "confab"}
    named = [(last_name(item), item) for item in own]
    return [*pairs(HINTS.get(kind, {})), *named, *pairs(shared), *pairs(common)]


def indexed(names: Iterable[tuple[str, str]], kind: str = "") -> Mapping[str | frozenset[str], str]:
    """Return the expression to use for each name, and for the words of each name.

    If several names have the same words, attributes of the object come first, then the shortest name, which has the fewest fillers.
    """
    latest = [*names][::-1]
    worst = sorted(latest, key=lambda pair: -len(pair[0]) * (pair[0] != re.split(r"\W", pair[1])[0]))
    return {**{words_of(name, kind): right for name, right in worst}, **dict(latest)}


@cache
def known(kind: str) -> Mapping[str | frozenset[str], str]:
    """Return the expression to use for each known name of a kind of object, and for the words of each known name."""
    return indexed(listed(kind), kind)


def elsewhere(kind: str, name: str | frozenset[str]) -> str:
    """Return the expression to use for a name, or for its words, of an object to which an object leads; empty if there is none."""
    for way, other in WAYS.get(kind, {}).items():
        if right := known(other).get(name):
            return right.removeprefix("scene." * (kind == "scene")) if WHOLE.match(right) else f"{way}.{right}"
    return ""


def certain(kind: str, name: str) -> str:
    """Return the expression to use for a name that the tables know; return an empty text for any other name.

    >>> certain("result", "elapsed"), certain("result", "subplans"), certain("plan", "xyzzy")
    ('seconds', 'plan.steps', '')
    """
    own = known(kind).get(name) or known(kind).get(parted(name)) or known(kind).get(words_of(name, kind))
    return own or elsewhere(kind, name) or elsewhere(kind, parted(name))


def of_form(kind: str, name: str) -> str:
    """Return the expression for a name of an object of another library that an object is converted to, or an empty text.

    >>> of_form("plan", "iterrows"), of_form("result", "iloc"), of_form("plan", "xyzzy")
    ('to_dataframe().iterrows()', 'plan.to_dataframe().iloc', '')
    """
    for form, path in FORMS.get(kind, {}).items():
        home, _, cls = path.rpartition(".")
        with suppress(ImportError):  # the library of an extra may not be installed
            found = getattr(getattr(import_module(home), cls), name, None)
            if found is not None:
                return f"{form}.{name}{'()' if callable(found) else ''}"
    return ""


def by_words(names: Iterable[tuple[str, str]], wanted: frozenset[str], kind: str = "") -> str:
    """Return the expression whose names have the greatest share of the wanted words; an empty text for less than `USUAL`.

    Of expressions with equal shares, the first one of the overview is returned.

    >>> by_words(pairs({"with_fact": "add set", "with_goal": "add_goal goal"}), frozenset(["add", "goal"]))
    'with_goal'
    """
    bags, order = dict[str, dict[str, float]](), dict[str, int]()
    for name, right in names:
        if name == last_name(right):
            order[right] = -len(order)
        words, bag = words_of(name, kind), bags.setdefault(right, {})
        share = (1.0 if words <= wanted else PART) + OWN * (name == last_name(right))
        bag.update({word: max(share, bag.get(word, 0.0)) for word in words & wanted})
    many = Counter(word for bag in bags.values() for word in bag)
    most = {word: max((bag.get(word, 0.0) for bag in bags.values()), default=0.0) for word in wanted}
    weights = {word: min(most[word], 1.0) * many[word] ** -0.5 if many[word] else UNKNOWN for word in wanted}
    worth = {
        right: sum(weights[word] * share for word, share in bag.items())
        * (1.0 if max(bag.values(), default=0.0) >= 1.0 else HALF)
        for right, bag in bags.items()
    }
    best = max(worth, key=lambda right: (round(worth[right], 6), order.get(right, -len(order))), default="")
    return best if best and worth[best] >= USUAL * sum(weights.values()) else ""


def misspelt(name: str, names: Collection[str]) -> str:
    """Return the name that a name with a typing error or with exchanged letters means; return an empty text if there is none."""
    near = get_close_matches(name, names, n=1, cutoff=TYPED)
    return near[0] if near else next((each for each in names if sorted(each) == sorted(name)), "")


def hint(kind: str, name: str, names: Collection[str] = ()) -> str:
    """Return the end of the error about a wrong name: the right name, or an overview of the object.

    Parameters
    ----------
    kind : str
        Description of the object, e.g. ``a scene``.
    name : str
        The wrong name.
    names : collection of str, optional
        The public names of the object.
    """
    short = kind.split()[-1]
    scene = "confab.load(SCENE)." if short == "confab" else "scene."  # users of the module may have no scene yet
    if right := certain(short, name):
        return f"; use {re.sub('^scene[.]', scene, right)}"
    if near := misspelt(name, names):
        return f"; did you mean '{near}'?"
    wanted = words_of(name, short)
    perhaps = of_form(short, name) or by_words(listed(short), wanted, short) or elsewhere(short, wanted)
    return f"; perhaps {re.sub('^scene[.]', scene, perhaps)}" * bool(perhaps) + overview(kind, names)


def overview(kind: str, names: Collection[str] = ()) -> str:
    """Return a sentence about the names of an object, by purpose; names that its class lacks are left out."""
    shown, home = list[str](), "confab." * (kind == "the module confab")
    for purpose, group in groups(kind.split()[-1]).items():
        own = [item for item in group if re.split(r"\W", item)[0] in names or re.match(rf"{WHOLE.pattern}.", item)]
        if own and purpose != "also":
            shown.append(f"{purpose}: {', '.join(item.removeprefix(home) for item in own)}")
    subject = kind.removeprefix("the class of ")
    return f". {subject[:1].upper()}{subject[1:]} has, {'; '.join(shown)}" if shown else ""


def chosen(name: str, names: Iterable[str]) -> str:
    """Return the known parameter or option that a wrong name most likely means, or an empty text.

    >>> chosen("timeout", ["goals", "time_limit"]), chosen("--timeout", ["--goal", "--time-limit"])
    ('time_limit', '--time-limit')
    >>> chosen("seed", ["goals", "time_limit"])
    ''
    """
    plain = {each.lstrip("-").replace("-", "_"): each for each in names}
    asked = name.lstrip("-").replace("-", "_").lower()
    if near := misspelt(asked, plain):
        return plain[near]
    rows = {there[0]: "" for rights in OPTIONS if (there := [right for right in rights.split() if right in plain])}
    for rights, others in OPTIONS.items():
        there = [right for right in rights.split() if right in plain]
        if there and asked in (*rights.split(), *others.split()):
            return plain[there[0]]
        if there:
            rows[there[0]] += f" {rights} {others}"
    if asked in dict(pairs(NEEDLESS)):
        return ""
    meant = by_words([*pairs(rows), *((each, each) for each in plain)], words_of(asked))
    return plain.get(meant, "")


def needless(name: str, names: Iterable[str] = ()) -> str:
    """Return the reason why a function or a command needs no parameter of this name, or an empty text.

    A function with the known parameter `sparql` takes values of variables in the query, not as parameters.

    >>> needless("random_state")
    'the same call gives the same result in every process'
    """
    reasons = dict(pairs(NEEDLESS))
    return reasons.get(name.lstrip("-").replace("-", "_").lower()) or reasons["bindings"] * ("sparql" in names)


def command(name: str, names: Iterable[str]) -> str:
    """Return the command that a wrong name most likely means, or an empty text if the name is a typing error or unknown.

    >>> command("simulate", ["plan"]), command("run-my-plan", ["plan"]), command("plna", ["plan"])
    ('verify', 'execute', '')
    """
    asked, words = name.lower().replace("-", "_"), [(each.replace("-", "_"), right) for each, right in pairs(COMMANDS)]
    meant = indexed(words)
    if asked in meant or misspelt(name, [*names]):
        return meant.get(asked, "")
    wanted = words_of(asked, "confab")
    return meant.get(wanted) or by_words(words, wanted)
