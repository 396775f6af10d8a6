"""Suggestions of the right name for a wrong name.

Each kind of object has a table of wrong names (`confab.hints`). A wrong name is looked up in this order:

1. as a whole, or with the same words in another order, in the table of its object;
2. among the names of the objects of other libraries that the object is converted to (``scene.graph``, ``plan.to_dataframe()``);
3. as a whole in the tables of the objects that are reachable from its object (``result.plan``)
   or, for a name of several words, in the tables of all other objects;
4. by its words in the table of its object;
5. as a whole in the tables of all other objects;
6. by words with the same meaning in the table of its object;
7. by its words in the public names and their descriptions. Words with the same meaning count as equal. The candidates are first
   the names of the object itself, then the names of objects in its attributes (``result.outcome.search``), then all other names
   (``scene.with_fact``).

If only a part of the words is known, up to three names are suggested.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from difflib import SequenceMatcher, get_close_matches
from functools import cache
from importlib import import_module

from confab.hints import COMMANDS, HINTS, NEEDLESS, OPTIONS

CLASSES = {
    "scene": "confab.scene.Scene",
    "result": "confab.planning.Result",
    "plan": "confab.planner.plan.Plan",
    "step": "confab.planner.plan.Step",
    "outcome": "confab.planner.plan.Outcome",
    "schedule": "confab.planner.timed.plan.TimedPlan",
    "labels": "confab.labels.Labels",
    "report": "confab.physics.Report",
    "execution": "confab.execution.Execution",
    "episode": "confab.planner.acting.episode.Episode",
    "table": "confab.table.Table",
    "memory": "confab.memory.Memory",
    "problem": "confab.reasoner.symbols.Problem",
    "domain": "confab.reasoner.symbols.Domain",
    "behaviour": "confab.reasoner.symbols.Behavior",
    "situation": "confab.reasoner.symbols.SituationType",
    "symbol": "confab.reasoner.symbols.Symbol",
    "fact": "confab.reasoner.symbols.Fact",
    "rollout": "confab.sim.verify.Rollout",
    "entry": "confab.sim.verify.StepReport",
    "verdict": "confab.sim.verdict.Verdict",
    "reason": "confab.planner.plan.Reason",
    "explanation": "confab.why.Because",
    "embodiment": "confab.reasoner.embodiment.values.Embodiment",
}
WAYS: Mapping[str, Mapping[str, str]] = {
    "confab": {"scene": "load(SCENE)"},
    "scene": {
        "result": "plan()",
        "report": "verify()",
        "execution": "execute()",
        "problem": "problem",
        "embodiment": "embodiment",
    },
    "result": {"plan": "plan", "outcome": "outcome", "schedule": "timed", "labels": "labels"},
    "execution": {"episode": "episode"},
    "problem": {"domain": "domain"},
    "entry": {"verdict": "verdict"},
    "fact": {"symbol": "symbol"},
}
"""The attribute or the call that leads from an object to another object, indexed by the kinds of the two objects."""
FORMS: Mapping[str, Mapping[str, str]] = {
    "scene": {
        "graph": "rdflib.Graph",
        "owl": "owlready2.World",
        "to_unified_planning()": "unified_planning.model.Problem",
    },
    "plan": {"to_dataframe()": "pandas.DataFrame", "to_networkx()": "networkx.DiGraph"},
    "execution": {"graph()": "networkx.DiGraph"},
    "table": {"dataframe()": "pandas.DataFrame"},
    "memory": {"table().dataframe()": "pandas.DataFrame"},
}
"""The attributes and calls that return an object of another library, each with the object's class."""
MEANINGS = """
load open read parse import consult initialize initialise start setup attach mount file ontology problem domain scene ttl turtle
load open owl rdf make world env gym
scenes examples datasets catalog list available builtin samples
families family generate random synthetic table benchmark
plan solve policy planner seek decompose think reason pyhop htn planning replan find compute start predict motion
query ask sparql select match cypher findall lookup retrieve question datalog search filter where
verify simulate simulation simulator physics physically rollout roll dry monte carlo test
execute run act perform dispatch apply step through carry drive real move play tick loop lookahead operate command walk resume
execute run proceed
validate lint check shacl consistent consistency errors error warnings warning problems
facts fact state initial init values now current belief beliefs knows know true situation world whereabouts where at location
facts fact status snapshot
goals goal task tasks objective desired target wanted todo mission aim purpose order request intention intent desire
objects object individuals individual instances things entities inventory stuff nodes resources contents bodies
behaviors behavior abilities ability capability capabilities methods method procedures commands tasks behaviours behaviour
behaviors behavior action actions operator operators skills schema schemas preconditions effects name
situations predicates fluents situation variables
arguments args params parameters operands objects
steps actions children kids decompose expand nested below inner subtasks parts components subplan subplans sub substeps
steps actions refinement decomposition sequence list trajectory
primitives primitive leaves low atomic flatten flat commands motions moves
cost metric price total objective reward expense effort fitness
rollouts runs trials episodes repeats repetitions attempts iterations
world simulator simulation backend env environment
interventions disturbances perturbations noise interrupts surprises
forgone soft preferences preference unmet unachieved violated open
within timeout deadline limit time budget
relations static constants
classes types sorts kinds hierarchy taxonomy
index find search locate position goto jump nth at get
engine solver planner backend
source path file filename uri url
output out file save destination
ground grounded grounding instantiate quantifying applicable
seconds time timeout deadline limit runtime duration elapsed wall cpu clock
search expanded expansions statistics stats nodes generated visited explored effort iterations evaluated
reason why because unsolvable failure failed error explain justify cause rationale motive background
report html page browser tab visualise visualize visualization render plot browser gantt chart
picture preview draw show plot render image png map visualise visualize screenshot svg diagram thumbnail figure
video film movie gif mp4 animation
graph triples rdf rdflib turtle ttl n3 jsonld serialize serialise save add
networkx graph nx digraph tree
save store write dump persist
export pddl bt behaviortree tree
json dict
dataframe df pandas csv excel frame
records dict dicts
rows head values tail
length levels num number count size depth shape
level depth layer height
solved success succeeded ok solvable done found feasible well went good worked works fine valid won
outcome status termination
bound optimal lower gap
timed schedule makespan duration timeline gantt
certificate proof
events timeline observations history log trace journal record transcript diary messages
replans repairs changes replanning
failures failure errors faults
faults valid invalid violations correct
memory experience learn learned train fit forget knowledge practice lessons
advice rules rule weights recall knowledge knows remembered learned lessons beliefs patterns insights
embodiment robot robots arms body urdf hardware gripper kinematics joints links
iri uri namespace namespaces prefixes base
names prefixes prefix namespaces namespace manager
with_fact fact set assert tell put remove without change update insert assume modify transform clone copy believe suppose
with_fact fact imagine pretend edit move relocate shift displace swap
with_goal goal set replace
rate accuracy probability score
label words text sentence name title
id index identifier uuid
affordances possible applicable available afford legal can do options choices able allowed doable feasible
serve server endpoint api rest http web host
board widget edit editor interactive gui ui
show print pretty display summary table stats statistics
__version__ version
"""
"""Groups of words with similar meanings, one group per line. The lines of a long group begin with the same two words."""
FILLERS = frozenset(
    {
        "get",
        "to",
        "as",
        "is",
        "has",
        "all",
        "n",
        "of",
        "the",
        "for",
        "in",
        "create",
        "new",
        "my",
        "with",
        "from",
        "what",
        "on",
        "was",
        "do",
        "does",
    }
)
OF_ANY = frozenset({"plan", "planning", "search"})
"""Words that are ignored if a name has other words."""
OF_MODULE = frozenset({"scene", "ontology", "file"})
"""Words that are ignored in names of the module `confab` if a name has other words."""
ENOUGH, FAR = 0.7, 0.1
"""Minimum score of a suggested name, and the amount by which each attribute or call on the way to the name reduces the score."""
MOST, NEAR = 3, 0.3
"""Maximum number of suggested names, and maximum difference of their scores from the best score."""
FAR_ROOT = 3
"""The distance of objects that aren't reachable by attributes and calls."""
ROOTS = ("plan", "result", "scene", "memory", "confab")
"""The kinds of objects that every user has, and the module; the kinds whose names are suggested first are first."""


@cache
def stem(word: str) -> str:
    """Return the stem of a word, for example ``simulat`` for ``simulators``."""
    return re.sub(
        r"(?<=\w{5})(ation|ing|ion|er|or|ed|ful|e)$", "", re.sub(r"(?<=[^s])s$", "", re.sub(r"ies$", "y", word))
    )


@cache
def meanings() -> Mapping[str, frozenset[int]]:
    """Return, for the stem of each word, the numbers of the lines in `MEANINGS` that contain the word."""
    lines = [[*map(stem, line.split())] for line in MEANINGS.strip().splitlines()]
    words = {word for line in lines for word in line}
    return {word: frozenset(i for i, line in enumerate(lines) if word in line) for word in words}


def alike(one: str, other: str) -> float:
    """Return the similarity of the meanings of two words, from 0 to 1."""
    if stem(one) == stem(other):
        return 1.0
    if meanings().get(stem(one), frozenset()) & meanings().get(stem(other), frozenset()):
        return 0.9
    near = SequenceMatcher(None, one, other).ratio()
    return near if near > 0.8 and min(len(one), len(other)) > 3 else 0.0


@cache
def known_words() -> frozenset[str]:
    """Return the stems of the words in `MEANINGS`, and the stems of the longer words in the tables."""
    listed = (words.split() for table in HINTS.values() for words in table.values())
    return frozenset(meanings()) | {stem(word) for names in listed for word in names if len(word) > SHORT}


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
def words_of(name: str) -> tuple[str, ...]:
    """Return the significant words of a name, for example ``plan`` and ``length`` for ``getPlanLength``."""
    words = tuple(word for run in re.findall(r"[^\W_]+", parted(name)) for word in segments(run) or (run,))
    return tuple(word for word in words if word not in FILLERS) or words


@cache
def described(kind: str) -> Mapping[str, str]:
    """Return the public names of a class, or of the module `confab`, each with the first line of its docstring."""
    if kind == "confab":
        module = import_module("confab")
        # `Memory` is the only class whose constructor users call
        names = ["Memory", *(n for n in module.__all__ if n.islower())]
        return {**{n: (getattr(module, n).__doc__ or "").split("\n")[0] for n in names}, "__version__": ""}
    home, _, name = CLASSES[kind].rpartition(".")
    cls = getattr(import_module(home), name)
    named = {field.name for field in fields(cls)} if is_dataclass(cls) else set[str]()
    found = {n for n in {*dir(cls), *named} if not n.startswith("_")}
    docs = {n: getattr(getattr(cls, n, None), "__doc__", None) or "" for n in found}
    return {n: "" if n in named else doc.strip().split("\n")[0] for n, doc in docs.items()}


def places(kind: str) -> Iterator[tuple[str, str, int]]:
    """Yield each kind of object that is reachable from `kind`, with an expression for the object and the expression's length."""
    waiting, seen = [(kind, "confab." if kind == "confab" else "", 0)], {kind}
    while waiting:
        here, before, far = waiting.pop(0)
        yield here, before, far
        for there, way in WAYS.get(here, {}).items():
            if there not in seen:
                seen.add(there)
                waiting.append((there, f"{before}{way}.", far + 1))
    for there in ROOTS:
        if there not in seen:
            yield there, f"{there}.", FAR_ROOT


def score(wanted: tuple[str, ...], name: str, doc: str) -> float:
    """Return a score of how well a name and its docstring match the wanted words; 1 is the maximum."""
    has, said = words_of(name), set(re.findall(r"[a-z]+", doc.lower()))
    met = [max(alike(word, one) for one in has) for word in wanted]
    told = [
        max(known, 0.6 * max((alike(word, one) for one in said), default=0.0))
        for word, known in zip(wanted, met, strict=True)
    ]
    extra = sum(max(alike(word, one) for word in wanted) == 0 for one in has)
    return 0.5 * max(told) + 0.5 * sum(told) / len(told) - 0.08 * extra


TYPED = 0.85
"""Minimum similarity to a known name for a wrong name to be treated as a typing error."""
PART = 0.6
"""Score of a matching word that is only a part of a longer name in the table."""
OWN = 0.1
"""Bonus for a matching word that is the name which the table's entry suggests."""
SYNONYM = 0.99
"""Maximum score of a word that an entry of a table has by its meaning only."""
SHORT = 3
"""Maximum length of the words of tables that aren't looked for inside other words."""
UNKNOWN, KNOWN = 0.4, 0.7
"""Weights of a word that occurs in no entry of a table: of a word without a known meaning, and of a word with one."""
HALF = 0.75
"""Factor for an entry of a table in which all matching words are only parts of longer names."""
KNOWN_WORDS, SURE = 0.4, 0.9
"""An entry of a table must have at least the first share of the words of a wrong name; with the second share, no other entries are
suggested. Rare words weigh more.
"""


def whole(table: Mapping[str, str], name: str) -> str:
    """Return the key of a table whose value contains a name, its plural or its singular."""
    for same in (str, lambda word: word.rstrip("s")):
        for right, others in table.items():
            if same(name) in map(same, others.split()):
                return right
    return ""


def same_words(table: Mapping[str, str], wanted: tuple[str, ...]) -> str:
    """Return the key of the entry of a table that has a name with exactly the wanted words, or an empty text.

    >>> same_words({"with_fact": "add_fact set", "facts": "state"}, ("facts", "add"))
    'with_fact'
    """
    found = [
        (len(name), len(right), right)  # the longer names have fillers
        for right, names in named(table).items()
        for name in names
        if {*map(stem, words_of(name))} == {*map(stem, wanted)}
    ]
    return min(found)[-1] if found else ""


def named(table: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Return the names of each entry of a table: first the name that the entry suggests, then the wrong names.

    >>> named({"confab.load(SCENE).plan()": "solve search"})
    {'confab.load(SCENE).plan()': ('plan', 'solve', 'search')}
    """
    own = {right: re.split(r"[ ,]", re.sub(r"\([^()]*\)", "", right))[0].rpartition(".")[2] for right in table}
    return {right: (own[right], *others.split()) for right, others in table.items()}


def by_words(
    table: Mapping[str, str], wanted: tuple[str, ...], least: float = KNOWN_WORDS, meant: bool = False
) -> list[str]:
    """Return the keys of the entries of a table that contain most of the wanted words, the best key first.

    The weight of a word is greater if fewer entries have it. With `meant`, a word that no entry has stands for words with the same
    meaning. If no entry has enough of the words, the list is empty.

    >>> by_words({"with_fact": "add set", "with_goal": "add", "facts": "state"}, ("add", "goal"))
    ['with_goal']
    """
    bags, asked = dict[str, dict[str, float]](), dict.fromkeys(map(stem, wanted))
    for right, names in named(table).items():
        bag = bags.setdefault(right, {})
        for number, name in enumerate(names):
            words = {*map(stem, words_of(name))}
            full = len(words) == 1 or words <= asked.keys()
            for word in words:
                bag[word] = max(bag.get(word, 0.0), 1.0 + OWN * (number == 0) if full else PART)
    many = Counter(word for bag in bags.values() for word in bag)
    weights = {word: many[word] ** -0.5 if many[word] else UNKNOWN for word in asked}
    for word in [word for word in asked if meant and word not in many]:
        weights[word] = by_meaning(word, bags, many)
    worth = {
        right: sum(weights[word] * bag.get(word, 0.0) for word in weights)
        * (1.0 if any(bag.get(word, 0.0) >= 1.0 for word in weights) else HALF)
        / sum(weights.values())
        for right, bag in bags.items()
    }
    best = sorted((right for right in worth if worth[right] >= least), key=lambda right: -worth[right])[:MOST]
    return [
        right for right in best if right == best[0] or (worth[best[0]] < SURE and worth[right] >= worth[best[0]] / 2)
    ]


def by_meaning(word: str, bags: Mapping[str, dict[str, float]], many: Mapping[str, int]) -> float:
    """Add a word that no entry has to the entries that have words with the same meaning, and return the weight of the word."""
    lines = meanings().get(word, frozenset())
    same = [other for other, found in meanings().items() if lines & found and other in many]
    shares = {right: sum(bag.get(other, 0.0) / many[other] for other in same) for right, bag in bags.items()}
    most = max(shares.values(), default=0.0)
    for right, share in shares.items():
        if share > 0:
            bags[right][word] = SYNONYM * share / most
    return KNOWN if most else UNKNOWN


def listed(names: Sequence[str]) -> str:
    """Return names as text: ``a, b, or c``."""
    return ", or ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def of_form(kind: str, name: str) -> str:
    """Return the expression for a name of an object of another library that an object is converted to, or an empty text.

    >>> of_form("plan", "groupby"), of_form("scene", "subject_objects"), of_form("plan", "xyzzy")
    ('to_dataframe().groupby()', 'graph.subject_objects()', '')
    """
    for form, path in FORMS.get(kind, {}).items():
        home, _, cls = path.rpartition(".")
        try:
            found = getattr(getattr(import_module(home), cls), name, None)
        except ImportError:  # the library of an extra isn't installed
            continue
        if found is not None:
            return f"{form}.{name}{'()' if callable(found) else ''}"
    return ""


def elsewhere(kind: str, name: str, most: int) -> str:
    """Return what the table of another kind of object suggests for a name; `most` attributes or calls lead to such an object.

    >>> elsewhere("confab", "load_result", 1), elsewhere("result", "groupby", 1), elsewhere("step", "groupby", 1)
    ('confab.load(SCENE).read_result(FILE)', 'plan.to_dataframe().groupby()', '')
    """
    for there, before, far in places(kind):
        if there == kind or far > most:
            continue
        if name in described(there):
            return before + name
        if right := whole(HINTS.get(there, {}), name):
            first = re.match(r"\w*", right)
            relative = first is not None and first[0] in described(there) and not right.startswith("scene.")
            return before + right if relative else right
        if right := of_form(there, name):
            return before + right
    return ""


def guessed(kind: str, name: str, known: Iterable[str] = ()) -> str:
    """Return, as text, the names that a user may mean by a wrong name, the most likely name first.

    If the wrong name is a known name with a typing error, an empty text is returned.

    >>> guessed("result", "planning_time"), guessed("result", "slove"), guessed("plan", "xyzzy")
    ('seconds', '', '')
    """
    table = HINTS.get(kind, {})
    if (
        meant := whole(table, name)
        or whole(table, name.lower())
        or whole(table, parted(name))
        or name.startswith("from_") * whole(table, "from_file")
    ):
        return meant
    if get_close_matches(name, [*known], n=1, cutoff=TYPED):
        return ""
    aside = {kind, *(OF_MODULE if kind == "confab" else ())}
    wanted = tuple(word for word in words_of(name) if stem(word) not in map(stem, aside)) or words_of(name)
    return (
        same_words(table, wanted)
        or of_form(kind, name)
        or listed(by_words(table, wanted, SURE))
        or elsewhere(kind, name, FAR_ROOT - (len(wanted) == 1))  # one word may mean different things in distant objects
        or listed(by_words(table, wanted, meant=len(wanted) > 1))
        or elsewhere(kind, name, FAR_ROOT)
        or listed(by_words(table, wanted, meant=True))
        or _described_as(kind, name)
        or listed(by_words(table, wanted, KNOWN_WORDS / 2, meant=True))
    )


def _described_as(kind: str, name: str) -> str:
    """Return, as text, the names whose words and descriptions have the meaning of a wrong name."""
    wanted = words_of(name)
    aside = OF_MODULE if kind == "confab" else OF_ANY
    wanted = tuple(word for word in wanted if alike(word, kind) < 1 and word not in aside) or wanted
    worth = {
        before + known: score(wanted, known, doc) - FAR * far
        for there, before, far in reversed([*places(kind)])
        for known, doc in described(there).items()
    }
    ranked = sorted(worth, key=lambda each: (-worth[each], len(each), each))[:MOST]
    return listed([each for each in ranked if worth[each] >= max(ENOUGH, worth[ranked[0]] - NEAR)])


def chosen(name: str, known: Iterable[str]) -> str:
    """Return the known parameter or option that a wrong name most likely means, or an empty text.

    >>> chosen("timeout", ["goals", "time_limit"]), chosen("--timeout", ["--goal", "--time-limit"])
    ('time_limit', '--time-limit')
    >>> chosen("seed", ["goals", "time_limit"])
    ''
    """
    plain = {each.lstrip("-").replace("-", "_"): each for each in known}
    asked = name.lstrip("-").replace("-", "_").lower()
    rows = dict[str, str]()
    for rights, others in OPTIONS.items():
        there = [right for right in rights.split() if right in plain]
        if there and asked in (*rights.split(), *others.split()):
            return plain[there[0]]
        if there:
            rows[there[0]] = f"{rows.get(there[0], '')} {rights} {others}"
    words = words_of(asked)
    if (
        meant := same_words(rows, words) or next(iter(by_words(rows, words, 0.1 + PART)), "")
    ) and not get_close_matches(asked, plain, n=1, cutoff=TYPED):
        return plain[meant]
    worth = {each: score(words_of(name), each, "") for each in known}
    best = max(worth, key=lambda each: worth[each], default="")
    return best if worth.get(best, 0.0) >= ENOUGH else ""


def needless(name: str, known: Iterable[str] = ()) -> str:
    """Return the reason why a function or a command needs no parameter of this name, or an empty text.

    A function with the known parameter `sparql` takes values of variables in the query, not as parameters.

    >>> needless("random_state")
    'the same call gives the same result in every process'
    """
    return whole(NEEDLESS, name.lstrip("-").replace("-", "_").lower()) or whole(
        NEEDLESS, "bindings" if "sparql" in known else ""
    )


def command(name: str, known: Iterable[str]) -> str:
    """Return the command that a wrong name most likely means, or an empty text if the name is a typing error or unknown.

    >>> command("simulate", ["plan"]), command("run-my-plan", ["plan"]), command("plna", ["plan"])
    ('verify', 'execute', '')
    """
    name = name.lower().replace("_", "-")
    words = {right: others.replace("-", "_") for right, others in COMMANDS.items()}
    meant = whole(COMMANDS, name)
    if meant or get_close_matches(name, [*known], n=1, cutoff=TYPED):
        return meant
    wanted = words_of(name.replace("-", "_"))
    wanted = tuple(word for word in wanted if word not in OF_MODULE) or wanted
    return same_words(words, wanted) or next(iter(by_words(words, wanted)), "")
