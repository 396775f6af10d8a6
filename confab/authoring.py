"""New domains, the differences between two versions of a scene, and the renaming of terms in a memory."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pyoxigraph as ox

from confab import ontology
from confab.accepting import named_for
from confab.memory import Memory
from confab.planner.paper.transitions import ground
from confab.planner.plan import Status
from confab.planner.solve import Mode
from confab.reasoner.amounts import written
from confab.reasoner.derivation import conditions_of_goal
from confab.reasoner.files import alone, made_folder, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import GENERATED
from confab.reasoner.memory.experience_file import MemoryLines
from confab.reasoner.names import local_name, nearest, right_arguments
from confab.reasoner.problem import Problem
from confab.reasoner.sentences import said
from confab.reasoner.symbols import Fact, Symbol, Times
from confab.reasoner.vocabulary import ARGUMENTS, CORE
from confab.show import bindings_of
from confab.table import Table

if TYPE_CHECKING:
    from confab.known import Known
    from confab.scene import Scene

PLACEHOLDER = "_DOMAIN_"
CATALOG = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<catalog prefer="public" xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
{entries}
</catalog>
"""
SPEAKS = "behavior does situationType relation termType ofClass first then refines isValueOf becomesValueOf byActor"
TERMS = [CORE + name for name in SPEAKS.split()]
WORDS = [CORE + name for name in ("asks", "answer")]
"""Properties whose values are texts with names of terms."""
ROLES = [CORE + name for name in ARGUMENTS]


@right_arguments
def new_domain(name: str, folder: str | Path | None = None, bodies: bool = False) -> list[Path]:
    """Write a valid, commented skeleton of a domain with a scene and a catalog, and return the paths of its files.

    By default the folder is named after the domain. With `bodies`, the skeleton also has a table, shapes and skills, so that a
    plan can be executed in physics. The catalog also lists the files of the shipped ontologies, so that Protégé finds them.

    Raises
    ------
    KnowledgeError
        A file of the skeleton exists already; or the name doesn't begin with a letter, or has characters other than letters,
        digits, ``_`` and ``-``.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     files = new_domain("plates", folder)
    ...     [file.name for file in files], len(validate(folder + "/plates-scene.ttl"))
    (['plates-scene.ttl', 'plates.ttl', 'catalog-v001.xml'], 0)
    """
    if not re.fullmatch(r"[A-Za-z][\w-]*", name):
        raise KnowledgeError(f"'{name}' can't be a domain's name: wanted a letter, then letters, digits, _ or -")
    templates = sorted((ontology.ROOT / "skeleton" / ("bodies" if bodies else "")).glob("*.ttl"))
    folder = Path(name if folder is None else folder)
    texts = {
        template.name.replace(PLACEHOLDER, name): template.read_text(encoding="utf-8").replace(PLACEHOLDER, name)
        for template in templates
    }
    places = {f"https://example.org/{Path(file).stem}": file for file in texts}
    places |= {iri: file.as_uri() for iri, file in ontology.shipped().items()}
    entries = "\n".join(f'  <uri name="{iri}" uri="{place}"/>' for iri, place in places.items())
    texts[ontology.CATALOG] = CATALOG.format(entries=entries)
    files = {folder / file: text for file, text in texts.items()}
    for file in files:
        if file.exists():
            raise KnowledgeError(f"{file} exists already; give another name or folder")
    made_folder(folder)
    for file, text in files.items():
        write_whole(file, text)
    return list(files)


@right_arguments
def validate(*files: str | Path, deep: bool = False) -> Table:
    """Return a table of the findings in ontology files and their imports, with a remedy for each finding.

    With `deep`, HermiT runs, too, which needs Java.

    Raises
    ------
    KnowledgeError
        A file doesn't exist, or a deep validation is requested and Java isn't installed.

    Examples
    --------
    >>> len(validate("beverage-serving"))
    0
    """
    from confab.reasoner.validation.validate import validate as check

    if not files:
        raise KnowledgeError("got no file; wanted validate(FILE, …), where FILE may be the name of a shipped scene")
    for file in files:
        if not isinstance(file, str | Path):
            path = getattr(getattr(file, "knowledge", None), "path", None)
            own = f"; this scene's is {str(path)!r}" if path is not None else ""
            raise KnowledgeError(f"got {type(file).__name__}; validate takes files or names of shipped scenes{own}")
    columns = ("severity", "place", "rule", "what", "why", "do")
    rows = (
        (f.severity, f"{Path(f.file).name}:{f.line}" if f.line else Path(f.file).name, f.rule, f.what, f.why, f.remedy)
        for f in check(files, deep=deep)
    )
    return Table(columns, tuple(rows), empty="nothing is wrong")


@right_arguments
def generate(
    family: str, path: str | Path | None = None, objects: int = 4, hands: int = 2, clutter: int = 0, seed: int = 0
) -> Scene:
    """Return a generated scene of a family (docs/quantification.md), and write it as an ontology file if a path is given.

    Raises
    ------
    KnowledgeError
        The family doesn't exist, no table fits the number of objects or hands, or the path doesn't end in ``.ttl``.

    Examples
    --------
    >>> generate("served", objects=10).plan().plan.length[1]
    11
    """
    from confab.reasoner.generate import write_scene
    from confab.scene import load, load_text

    if path is None:
        with TemporaryDirectory() as folder:
            file = Path(folder, f"{family}.ttl")
            write_scene(file, family, objects, hands, clutter, seed)
            return load_text(file.read_bytes())
    write_scene(named_for(GENERATED, path), family, objects, hands, clutter, seed)
    return load(path)


# ---------------------------------------------------------------------------------------------- comparison of two versions


@dataclass(frozen=True)
class Difference:
    """The difference between two versions of a scene: the added and removed names, facts and goals, and the lines of both plans."""

    gained: dict[str, tuple[str, ...]]
    lost: dict[str, tuple[str, ...]]
    before: tuple[str, ...]
    after: tuple[str, ...]

    def json(self) -> dict[str, Any]:
        """Return the difference as JSON data."""
        return {
            "gained": {kind: list(names) for kind, names in self.gained.items()},
            "lost": {kind: list(names) for kind, names in self.lost.items()},
            "plan": {"before": list(self.before), "after": list(self.after), "same": self.before == self.after},
        }

    def __str__(self) -> str:
        """Return the difference as lines that start with ``+`` and ``-``."""
        lines = []
        for kind in self.gained:
            lines += [f"- {kind} {name}" for name in self.lost[kind]]
            lines += [f"+ {kind} {name}" for name in self.gained[kind]]
        if self.before == self.after:
            none = [line for line in self.after if line.startswith(tuple(f"{status.value}: " for status in Status))]
            return "\n".join([*lines, *(none or [f"the plan is the same: {len(self.after)} steps"])])
        import difflib

        changes = difflib.unified_diff(self.before, self.after, "plan before", "plan after", lineterm="", n=1)
        return "\n".join([*lines, *changes])


def difference(old: Scene, new: Scene, mode: Mode) -> Difference:
    """Return the difference between two versions of a scene in their names, facts, goals and plans."""
    before, after = _inventory(old), _inventory(new)
    return Difference(
        {kind: tuple(n for n in after[kind] if n not in set(before[kind])) for kind in after},
        {kind: tuple(n for n in before[kind] if n not in set(after[kind])) for kind in before},
        _lines(old, mode),
        _lines(new, mode),
    )


def _inventory(scene: Scene) -> dict[str, list[str]]:
    problem = scene.problem
    grounds = [g for level in problem.domain.levels for g in ground(problem, level)]
    return {
        "individual": sorted(problem.individuals),
        "situation type": sorted(problem.domain.situations),
        "behaviour": list(problem.domain.behaviors),
        "fact": scene.facts,
        "goal": [_goal(problem, symbol) for symbol in sorted(problem.goal)],
        "quantified": [" ".join((g.behavior, *g.arguments)) for g in grounds],
    }


def _goal(problem: Problem, symbol: Symbol) -> str:
    """Return the text of a goal, with its conditions, its deadline and its weight if it has them."""
    text, by = str(Fact(symbol, problem.goal[symbol])), (problem.times or Times()).deadlines.get(symbol)
    if conditions := conditions_of_goal(problem.domain, symbol):
        text += f", which means {' and '.join(map(said, conditions))}"
    if by is not None:
        text += f" by {written(by)} s"
    return f"{text} (weight {written(problem.weights[symbol])})" if symbol in problem.weights else text


def _lines(scene: Scene, mode: Mode) -> tuple[str, ...]:
    """Return the plan of a scene, one line per step, or the reason why the scene has no plan."""
    result = scene.plan(mode=mode)
    if not result.solved:
        reason = result.outcome.reason
        return (f"{result.outcome.status.value}: {reason.text if reason else ''}",)
    return tuple(
        "  " * (len(step.path) - 1) + " ".join((step.behavior, *step.arguments)) + bindings_of(step)
        for step in result.plan.walk()
    )


# ------------------------------------------------------------------------------------------------------- memory and renames


def unknown_terms(memory: MemoryLines, scene: Known) -> list[str]:
    """Return the terms of the domain that a memory mentions and the scene doesn't contain.

    Each term is mapped to the most similar name in the scene.

    The paper's links may name individuals of other scenes; these individuals don't count as terms of the domain.
    """
    spoken: set[str] = set()
    with suppress(SyntaxError):  # `Memory.load` reports a syntax error
        kinds = {t.subject for t in memory.triples if getattr(t.object, "value", "") == CORE + "GoalKind"}
        spoken = {
            t.object.value
            for t in memory.triples
            if isinstance(t.object, ox.NamedNode)
            and (t.predicate.value in TERMS or (t.subject in kinds and t.predicate.value in ROLES))
        }
    # the reader makes situation types, such as "ended" of an at-most-once type
    graph, made = scene.knowledge, scene.names.iris
    asked = " ".join(str(ox.NamedNode(iri)) for iri in sorted(spoken.difference(made)))
    rows = graph.select(f"SELECT ?x WHERE {{ VALUES ?x {{ {asked} }} FILTER EXISTS {{ ?x ?p ?o }} }}") if asked else []
    unknown = sorted(spoken.difference(made) - {x.value for (x,) in rows if isinstance(x, ox.NamedNode)})
    names = (
        {local_name(q.subject.value) for q in graph.store if isinstance(q.subject, ox.NamedNode)} if unknown else set()
    )
    elsewhere = [f"<{iri}>" for iri in unknown if local_name(iri) in names]  # the name is a term of another domain
    return [*elsewhere, *(f"{name}{nearest(name, names)}" for name in map(local_name, unknown) if name not in names)]


def migrate(memory: Path, renames: Sequence[str]) -> int:
    """Rename terms in a memory file, and return the number of changed triples.

    Each element of `renames` is ``OLD=NEW``, where OLD and NEW are IRIs or the last parts of IRIs. If NEW is only the last part
    of an IRI, it gets the namespace of OLD.

    Raises
    ------
    KnowledgeError
        The file isn't a memory, or OLD doesn't name exactly one term of the memory.
    """
    with alone(memory):
        quads, prefixes = _parse(memory)
        terms = [term for quad in quads for term in (quad.predicate, quad.object)]
        iris = {term.value for term in terms if isinstance(term, ox.NamedNode)}
        table = dict(_rename(text, iris) for text in renames)
        words = {local_name(old): local_name(new) for old, new in table.items()}
        changed = [_renamed(quad, table, words) for quad in quads]
        text = ox.serialize(changed, format=ox.RdfFormat.TURTLE, prefixes=prefixes) or b""
        write_whole(memory, text, check=Memory.load)
    return sum(one != other.triple for one, other in zip(changed, quads, strict=True))


def _rename(text: str, iris: set[str]) -> tuple[str, str]:
    old, sign, new = text.partition("=")
    if not (old and sign and new):
        raise KnowledgeError(f"'{text}' is no rename; wanted OLD=NEW, e.g. Cup=Mug")
    found = [iri for iri in iris if old in (iri, local_name(iri))]
    if len(found) != 1:
        what = "isn't in the memory" if not found else f"could be {' or '.join(sorted(found))}"
        raise KnowledgeError(f"'{old}' {what}{nearest(old, map(local_name, iris)) if not found else '; give the IRI'}")
    namespace = found[0][: len(found[0]) - len(local_name(found[0]))]
    iri = new if "://" in new else namespace + new
    try:
        return found[0], ox.NamedNode(iri).value
    except ValueError as error:
        raise KnowledgeError(f"'{text}': <{iri}> is no IRI; wanted a name without blanks and signs") from error


def _renamed(quad: ox.Quad, table: dict[str, str], words: dict[str, str]) -> ox.Triple:
    """Return a triple in which terms have their new names, both in IRIs and in texts."""
    value: Any = quad.object
    if isinstance(value, ox.NamedNode):
        value = ox.NamedNode(table.get(value.value, value.value))
    elif isinstance(value, ox.Literal) and quad.predicate.value in WORDS:
        value = ox.Literal(re.sub(r"\w+", lambda match: words.get(match[0], match[0]), value.value))
    subject: Any = quad.subject
    if isinstance(subject, ox.NamedNode):
        subject = ox.NamedNode(table.get(subject.value, subject.value))
    return ox.Triple(subject, quad.predicate, value)


def _parse(memory: Path) -> tuple[list[ox.Quad], dict[str, str]]:
    """Return the quads and the prefixes of a memory file."""
    if not memory.is_file():
        raise KnowledgeError(f"{memory}: no such memory file")
    Memory.load(memory)  # `Memory.load` has more precise error messages than the parser
    parser = ox.parse(path=str(memory), format=ox.RdfFormat.TURTLE, base_iri=memory.resolve().as_uri())
    quads = list(parser)
    return quads, dict(parser.prefixes)
