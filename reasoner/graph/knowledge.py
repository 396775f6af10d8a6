"""The knowledge graph: ontology files with all their imports in one SPARQL store.

Each kind of triples has its own named graph (`GRAPHS`); a query is evaluated on their union. Files are only read, never changed.
Nothing is downloaded (only `confab.reasoner.graph.fetching` downloads, on request): imports are looked up in the catalog in the
file's folder, then in the shipped catalog.
"""

from __future__ import annotations

import glob
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias
from urllib.parse import unquote

import pyoxigraph as ox

from confab import ontology
from confab.reasoner.graph.documents import DocumentError, document
from confab.reasoner.limits import check, checked
from confab.reasoner.names import brief, nearest
from confab.reasoner.vocabulary import CORE, OWL, PREFIXES, TYPE

if TYPE_CHECKING:
    from confab.reasoner.updates.compiling import UpdateFault
    from confab.reasoner.updates.texts import TextPosition

BASE = "urn:confab:graph:"
GRAPHS = ("asserted", "inferred", "reach", "observed", "memory", "episodes")
DERIVED = "derived"
"""Graph of the facts that are derived in the initial state, used only by users' queries."""
SCENE = ("asserted", "inferred", "reach")
"""Graphs that planning reads."""
TRIPLE_TERMS = (b"<<", b"{|", b"parseType")
"""The three notations of triple terms (triples as subjects or objects) in files."""
HAS_TRIPLE_TERM = "ASK { ?s ?p ?o FILTER(isTRIPLE(?o)) }"
ONTOLOGIES = """
SELECT ?iri (EXISTS { ?other owl:imports ?iri FILTER(?other != ?iri) } AS ?imported) WHERE { ?iri a owl:Ontology } ORDER BY ?iri"""
SPARQL_TEXTS = (CORE + "update", CORE + "construct")
"""Properties whose values are SPARQL texts, which use the prefixes of their file."""
NO_ROWS = "wanted a SELECT query, whose answer is rows"

Term = ox.NamedNode | ox.BlankNode | ox.Literal | None
Row = tuple[Term, ...]


Answer: TypeAlias = ox.QuerySolutions | ox.QueryTriples | ox.QueryBoolean


class Remote(Protocol):
    """A remote store that answers SPARQL 1.1 queries, such as `confab.reasoner.graph.stores.Endpoint`."""

    def query(self, query: str, prefixes: Mapping[str, str], bindings: Mapping[str, str], noted: bool = True) -> Answer:
        """Return the result of a query. If `noted`, the store remembers the query, and `confirm` repeats the query later."""

    def confirm(self) -> None:
        """Repeat the noted queries; raise `KnowledgeError` if a result has changed."""


class KnowledgeError(ValueError):
    """Raised if the given knowledge can't be used; the message states the fault, its position and the remedy.

    `node` is the IRI of the faulty node, or an empty text. `rule` is the name of the validation rule that the fault violates.
    """

    def __init__(self, message: str = "", node: str = "", rule: str = "unreadable") -> None:
        super().__init__(message)
        self.node, self.rule = node, rule


def text(term: Term) -> str:
    """Return the IRI or literal of a term as text; return an empty text for an unbound variable."""
    return term.value if term is not None else ""


@brief
@dataclass
class KnowledgeGraph:
    """A scene and all ontologies that it imports.

    Attributes
    ----------
    scene : str
        IRI of the scene's ontology.
    store : pyoxigraph.Store
        Store with the named graphs in `GRAPHS`.
    files : mapping of ontology IRI to file
        The files in the graph `asserted`; the scene's file is the first.
    prefixes : mapping of prefix to namespace
        The prefixes of internal queries: `PREFIXES` and prefixes that files declare.
    declared : mapping of prefix to namespace
        The prefixes that files declare, the prefixes of the scene's file first. The empty prefix stands for the namespace that
        the scene's file declares.
    faults : list of str
        The reasons why planning in the scene is impossible, if the scene was loaded with `tolerant`.
    written : mapping of individual to place
        For each individual that was compiled from a SPARQL update, the position in this update.
    compiled : set of pyoxigraph.Triple
        The triples that were compiled from SPARQL updates; no file states them.
    remote : Remote, optional
        A remote store that is queried instead of `store`; it is never changed.
    round_trips : int
        Number of queries so far.
    changes : tuple of str
        The changes of facts and goals since the files were read, as options of the command line.
    """

    scene: str
    store: ox.Store = field(default_factory=ox.Store)
    files: dict[str, Path] = field(default_factory=dict)
    prefixes: dict[str, str] = field(default_factory=lambda: dict(PREFIXES))
    declared: dict[str, str] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    written: dict[str, TextPosition] = field(default_factory=dict)
    compiled: set[ox.Triple] = field(default_factory=set)
    remote: Remote | None = None
    round_trips: int = 0
    changes: tuple[str, ...] = ()

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling and copying, with the store as N-Quads."""
        return {**self.__dict__, "store": self.store.dump(format=ox.RdfFormat.N_QUADS) or b""}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled state with a new store, in which blank nodes have the same names."""
        store = ox.Store()
        store.bulk_extend(ox.parse(state["store"], format=ox.RdfFormat.N_QUADS, rename_blank_nodes=False))
        self.__dict__.update(state, store=store)

    @property
    def spoken(self) -> dict[str, str]:
        """The prefixes for users' queries: ``confab:``, prefixes of the scene's file, and prefixes of internal queries."""
        return {"confab": CORE, **self.prefixes, **self.declared}

    def require_whole(self) -> None:
        """Raise `KnowledgeError` if planning in the scene is impossible."""
        if self.faults:
            raise KnowledgeError(self.faults[0])

    def select(self, query: str, graphs: Sequence[str] = GRAPHS, **bindings: str) -> list[Row]:
        """Return the rows of a SELECT query on the union of some graphs; `bindings` maps selected variables to IRIs.

        Raises
        ------
        KnowledgeError
            The query isn't SPARQL; the message states line and column.
        """
        rows = self.solutions(query, graphs, **bindings)
        return [tuple(row) for row in checked(rows, "querying the knowledge graph")]

    def solutions(self, query: str, graphs: Sequence[str] = GRAPHS, **bindings: str) -> ox.QuerySolutions:
        """Return an iterator over the rows of a SELECT query, with the same errors as `select` and less memory."""
        answer = self.query(query, graphs, **bindings)
        if not isinstance(answer, ox.QuerySolutions):
            raise KnowledgeError(NO_ROWS)
        return answer

    def ntriples(self, graphs: Sequence[str] = GRAPHS) -> bytes:
        """Return the triples of some graphs as N-Triples; for a remote store, all triples of its dataset."""
        if self.remote:
            answer = self.query("CONSTRUCT { ?s ?p ?o } WHERE { ?s ?p ?o }")
            return (
                answer.serialize(format=ox.RdfFormat.N_TRIPLES) or b"" if isinstance(answer, ox.QueryTriples) else b""
            )
        triples = {
            q.triple
            for name in graphs
            for q in self.store.quads_for_pattern(None, None, None, ox.NamedNode(BASE + name))
        }
        return ox.serialize(sorted(triples, key=str), format=ox.RdfFormat.N_TRIPLES) or b""

    def turtle(self) -> str:
        """Return the stated triples, without triples that were compiled from SPARQL updates, as Turtle."""
        if self.remote:
            raise KnowledgeError(f"{self.scene}: a remote store is only read; export it with its own tools")
        prefixes = {**self.prefixes, **self.declared}
        quads = self.store.quads_for_pattern(None, None, None, ox.NamedNode(BASE + "asserted"))
        stated = {quad.triple for quad in quads} - self.compiled
        for subject, own in _spelled(self).items():  # a file may declare the same prefixes for other namespaces
            lines = "".join(f"PREFIX {prefix}: <{iri}>\n" for prefix, iri in own.items() if prefixes.get(prefix) != iri)
            for triple in [t for t in stated if lines and t.subject == ox.NamedNode(subject)]:
                if triple.predicate.value in SPARQL_TEXTS and isinstance(triple.object, ox.Literal):
                    literal = ox.Literal(lines + triple.object.value)
                    stated = stated - {triple} | {ox.Triple(triple.subject, triple.predicate, literal)}
        ordered = sorted(stated, key=str)
        return (ox.serialize(ordered, format=ox.RdfFormat.TURTLE, prefixes=prefixes) or b"").decode("utf-8")

    def query(self, query: str, graphs: Sequence[str] = GRAPHS, **bindings: str) -> Answer:
        """Return the result of any SPARQL 1.1 query on the union of some graphs; for a remote store, on its own dataset."""
        check("querying the knowledge graph")
        self.round_trips += 1
        if self.remote:
            return self.remote.query(query, self.prefixes, bindings)
        try:
            return self.store.query(
                query,
                prefixes=self.prefixes,
                default_graph=[ox.NamedNode(BASE + name) for name in graphs],
                substitutions={ox.Variable(name): ox.NamedNode(iri) for name, iri in bindings.items()},
            )
        except SyntaxError as error:
            raise KnowledgeError(f"the query is not SPARQL 1.1: {error}") from error

    def confirm(self) -> None:
        """Raise `KnowledgeError` if the data in a remote store have changed since the data were read."""
        if self.remote:
            check("repeating a query to the knowledge graph")
            self.remote.confirm()

    def add(self, graph: str, triples: Iterable[tuple[str, str, str]]) -> None:
        """Add triples of IRIs to a named graph."""
        if self.remote:
            raise KnowledgeError(f"{self.scene}: a remote store is only read; add to it with its own tools")
        name = ox.NamedNode(BASE + graph)
        self.store.extend(ox.Quad(ox.NamedNode(s), ox.NamedNode(p), ox.NamedNode(o), name) for s, p, o in triples)

    def extend(self, graph: str, triples: Iterable[ox.Triple | ox.Quad]) -> None:
        """Add triples to a named graph of the store."""
        name = ox.NamedNode(BASE + graph)
        self.store.extend(ox.Quad(one.subject, one.predicate, one.object, name) for one in triples)

    @cached_property
    def path(self) -> Path | None:
        """The scene's file; None if the scene wasn't read from a file."""
        return self.files.get(self.scene)

    @property
    def folders(self) -> list[Path]:
        """The folders in which files that ontologies mention are searched: the shipped folder and each loaded file's folder."""
        own = (file.parent for file in self.files.values() if not file.is_relative_to(ontology.ROOT))
        return list(dict.fromkeys([ontology.ROOT, *own]))


def load(
    source: str | Path | Sequence[str | Path],
    store: ox.Store | None = None,
    tolerant: bool = False,
    faults: list[UpdateFault] | None = None,
    alone: bool = False,
) -> KnowledgeGraph:
    """Load a scene with all its imports, and its file of reachability facts if it exists.

    Parameters
    ----------
    source : str, Path or sequence of them
        Name of a shipped scene, or a file in Turtle, N-Triples, RDF/XML, JSON-LD, TriG or N-Quads. If several files are given, all
        are loaded, and the scene is the first file that no other file imports.
    store : pyoxigraph.Store, optional
        An empty store for the triples; by default a new store in memory.
    tolerant : bool
        Whether to load an RDF file even if it isn't a complete scene; the attribute `faults` of the graph then has the reasons.
    faults : list of UpdateFault, optional
        A list that receives the faults in behaviours that are written as updates. Without this list, a fault raises an error.
    alone : bool
        Whether the file stands for a text, which can import only shipped ontologies.

    Raises
    ------
    KnowledgeError
        The scene or file doesn't exist, a file has a syntax error, or no catalog contains an import.
    """
    given = [source] if isinstance(source, str | Path) else source
    path, *others = _scene_first([scene_file(one) for one in given])
    graph = KnowledgeGraph("", store=ox.Store() if store is None else store)
    _load(graph, path, others, tolerant, alone)
    found = write_out(graph)
    if faults is not None:
        faults += found
    elif found and tolerant:
        graph.faults += map(str, found)
    elif found:
        raise KnowledgeError(str(found[0]))
    return graph


def write_out(graph: KnowledgeGraph) -> list[UpdateFault]:
    """Compile the updates and queries of behaviours and rules into individuals, and return the faults in these texts."""
    texts = map(ox.NamedNode, (*SPARQL_TEXTS, CORE + "extends"))
    if not any(next(graph.store.quads_for_pattern(None, one, None, None), None) for one in texts):
        return []
    check("reading updates")
    from confab.reasoner.updates.compiling import compiled

    found = compiled(lambda query: graph.select(query, SCENE), _spelled(graph), graph.prefixes)
    asserted = ox.NamedNode(BASE + "asserted")
    quads = {ox.Quad(t.subject, t.predicate, t.object, asserted) for t in found.triples}
    graph.compiled |= {quad.triple for quad in quads if quad not in graph.store}
    graph.store.extend(quads)
    graph.written |= found.places
    return found.faults


def _spelled(graph: KnowledgeGraph) -> dict[str, dict[str, str]]:
    """Return, for each behaviour or rule that is written in SPARQL, the prefixes that its file declares."""
    prefixes: dict[str, dict[str, str]] = {}
    for file in graph.files.values():
        with readable(file) as (content, form):
            if b"update" not in content and b"construct" not in content:
                continue
            parser = ox.parse(content, format=form, base_iri=file.resolve().as_uri())
            behaviors = [text(quad.subject) for quad in parser if quad.predicate.value in SPARQL_TEXTS]
            own = dict(parser.prefixes)
            prefixes |= dict.fromkeys(behaviors, own)
    return prefixes


def _scene_first(files: Sequence[Path]) -> list[Path]:
    """Return files in an order that begins with the scene, the first file that no other file imports."""
    if not files:
        raise KnowledgeError("no file is given; wanted the name of a shipped scene, or files of RDF")
    if len(files) == 1:
        return [*files]
    imported = {file: _said(file, "imports") for file in files}
    scene = next(
        (
            file
            for file in files
            if not any(_said(file, "Ontology") & imported[other] for other in files if other != file)
        ),
        files[0],
    )
    return [scene, *(file for file in dict.fromkeys(files) if file != scene)]


def _said(file: Path, what: str) -> set[str]:
    """Return the IRIs of the ontologies that a file declares (`what` is ``Ontology``) or imports (``imports``)."""
    with readable(file) as (content, form):
        quads = list(ox.parse(content, format=form, base_iri=file.resolve().as_uri()))
    if what == "imports":
        found = (quad.object for quad in quads if quad.predicate.value == OWL + what)
    else:
        found = (q.subject for q in quads if q.predicate.value == TYPE and q.object == ox.NamedNode(OWL + what))
    return {term.value for term in found if isinstance(term, ox.NamedNode)}


def _load(graph: KnowledgeGraph, path: Path, others: Sequence[Path], tolerant: bool, alone: bool) -> None:
    @contextmanager
    def forgiven() -> Iterator[None]:
        try:
            yield
        except KnowledgeError as error:
            if not tolerant:
                raise
            graph.faults.append(str(error))

    read_into(graph, path, "asserted")
    graph.scene = path.as_uri()
    inside = {iri: text(imported) == "true" for iri, imported in graph.select(ONTOLOGIES)}
    with forgiven():
        graph.scene = _scene_of(path, inside)
    given = {iri: file for file in others for iri in sorted(_said(file, "Ontology") or {file.as_uri()})}
    waiting = [(graph.scene, path), *given.items()]
    places: dict[Path, Mapping[str, Path]] = {}
    done = set[str]()
    while waiting:
        iri, file = waiting.pop(0)
        if iri in done:
            continue
        done.add(iri)
        if file != path:
            with forgiven():
                read_into(graph, file, "asserted")
        if file != path or iri == graph.scene:
            graph.files[iri] = file
        for imported in _imports(graph, iri):
            if ox.NamedNode(imported) in inside:  # the scene's file contains this ontology
                waiting.append((imported, path))
            elif imported not in done:
                with forgiven():
                    waiting.append((imported, given.get(imported) or _locate(imported, file, places, alone)))
    reach = path.with_name(f"{path.stem}.reach.ttl")
    if reach.is_file():
        read_into(graph, reach, "reach")
        _forget_what_names_nothing(graph)


def _forget_what_names_nothing(graph: KnowledgeGraph) -> None:
    """Remove refutations about individuals that the scene no longer contains (`confab.reasoner.refutations`)."""
    store, reach, asserted = graph.store, ox.NamedNode(BASE + "reach"), ox.NamedNode(BASE + "asserted")
    refuted = list(store.quads_for_pattern(None, ox.NamedNode(CORE + "precondition"), None, reach))
    quads = list(store.quads_for_pattern(None, None, None, reach)) if refuted else []
    for first in refuted:
        stem = str(first.object).strip("<>")
        own = [first, *(quad for quad in quads if str(quad.subject).startswith(f"<{stem}"))]
        said = {term for quad in own if quad.predicate.value != TYPE for term in (quad.subject, quad.object)}
        names = [term for term in said if isinstance(term, ox.NamedNode) and not term.value.startswith(stem)]
        kind = ox.NamedNode(TYPE)
        if any(next(store.quads_for_pattern(name, kind, None, asserted), None) is None for name in names):
            for quad in own:
                store.remove(quad)


def scene_file(source: str | Path) -> Path:
    """Return the file of a scene that is given by its name or path."""
    shipped = ontology.scenes()
    if str(source) in shipped:
        return shipped[str(source)]
    path = Path(source)
    if path.is_file():
        return path.resolve()
    found = sorted(path.iterdir() if path.is_dir() else path.parent.glob(f"{glob.escape(path.name)}.*"))
    files = [file for file in found if file.suffix in ontology.SUFFIXES]
    files.sort(key=lambda file: "scene" not in file.stem)
    if files or path.is_dir():
        which = f"; did you mean '{files[0]}'?" if files else ", without a file of an ontology in it"
        raise KnowledgeError(f"'{source}' is {'a folder' if path.is_dir() else 'no file'}{which}")
    if len(path.parts) > 1 or path.suffix in ontology.SUFFIXES:
        hint = f"; did you mean the shipped scene '{path.stem}'?" if path.stem in shipped else ""
        raise KnowledgeError(f"no scene '{source}': there is no such file{hint}")
    shipped = {name: file for name, file in shipped.items() if str(source).lower() in name} or shipped
    if near := nearest(str(source), shipped).removeprefix("; "):
        raise KnowledgeError(f"no scene '{source}': neither a file nor a shipped scene; {near}")
    raise KnowledgeError(f"no scene '{source}': neither a file nor a shipped scene ({', '.join(shipped)})")


def read_into(graph: KnowledgeGraph, file: Path, name: str) -> None:
    """Load a file into a named graph, and add its prefixes."""
    check(f"reading {file}")
    with readable(file) as (content, form):
        timed = _TimedInput(content, f"reading {file}")
        if form.supports_datasets:  # all graphs of the file become one graph
            graph.extend(name, ox.parse(timed, format=form, base_iri=file.resolve().as_uri()))
        else:
            target = ox.NamedNode(BASE + name)
            graph.store.load(input=timed, format=form, base_iri=file.resolve().as_uri(), to_graph=target)
        if any(sign in content for sign in TRIPLE_TERMS) and graph.query(HAS_TRIPLE_TERM, [name]):
            raise KnowledgeError(f"{file}: contains triple terms (RDF 1.2), which OWL doesn't have; remove them")
        read_prefixes(graph, file)


class _TimedInput(BytesIO):
    """A byte stream that raises `LimitError` at the deadline, so that a parser stops reading."""

    def __init__(self, content: bytes, doing: str) -> None:
        super().__init__(content)
        self.doing = doing

    def read(self, size: int | None = -1) -> bytes:
        """Return the next bytes, or raise `LimitError` after the deadline."""
        check(self.doing)
        return super().read(size)


@contextmanager
def readable(file: Path) -> Iterator[tuple[bytes, ox.RdfFormat]]:
    """Provide the content and the format of an RDF file; convert errors inside the context to `KnowledgeError`."""
    try:
        yield document(file)
    except SyntaxError as error:
        raise KnowledgeError(f"{file}: {error.msg}") from error
    except DocumentError as error:
        raise KnowledgeError(f"{file}: {error}") from error
    except OSError as error:
        raise KnowledgeError(f"{file}: can't be read: {error.strerror or error}") from error


def read_prefixes(graph: KnowledgeGraph, file: Path) -> None:
    """Add the prefixes that a file declares; an empty prefix is added only from the first file."""
    first = not graph.declared
    with readable(file) as (content, form):
        parser = ox.parse(content, format=form, base_iri=file.resolve().as_uri())
        list(islice(parser, 1))
    for prefix, namespace in parser.prefixes.items():
        graph.prefixes.setdefault(prefix, namespace)
        if prefix or first:
            graph.declared.setdefault(prefix, namespace)


def _scene_of(path: Path, inside: Mapping[Term, bool]) -> str:
    """Return the IRI of the scene in a file: the only ontology that no other ontology of the file imports."""
    roots = [iri for iri, imported in inside.items() if not imported]
    if len(roots) == 1 and isinstance(roots[0], ox.NamedNode):
        return roots[0].value
    which = f": {', '.join(map(str, roots or inside))}" if len(inside) > 1 else ""
    circle = ", all imported by another one" if inside and not roots else ""
    raise KnowledgeError(
        f"{path}: wanted one 'a owl:Ontology' with an IRI, which no other ontology of the file imports, "
        f"found {len(roots or inside)}{circle}{which}; a scene declares itself with it"
    )


def _imports(graph: KnowledgeGraph, iri: str) -> Sequence[str]:
    rows = graph.select(
        "SELECT ?ontology ?import WHERE { ?ontology owl:imports ?import } ORDER BY ?import", ontology=iri
    )
    return [row[1].value for row in rows if isinstance(row[1], ox.NamedNode)]


def _locate(iri: str, importer: Path, read: dict[Path, Mapping[str, Path]], alone: bool) -> Path:
    """Return the file of an imported ontology, found in the catalog beside the importer, in the shipped catalog, or by its name."""
    beside = importer.with_name(ontology.CATALOG)
    for catalog in (beside, ontology.ROOT / ontology.CATALOG):
        if catalog not in read:
            read[catalog] = _catalog(catalog)
        if iri in read[catalog]:
            found = read[catalog][iri]
            if not found.is_file():
                missing = "is a link that leads to no file" if found.is_symlink() else "doesn't exist"
                raise KnowledgeError(f"{catalog}: <{iri}> shall lie in {found}, which {missing}; correct the entry")
            return found
    for suffix in ontology.SUFFIXES:
        path = importer.with_name(unquote(iri.rstrip("#/").rsplit("/", 1)[-1]).replace("/", "_") + suffix)
        if path.is_file():
            return path
    web = iri.startswith(("http://", "https://"))
    fetch = f", or fetch it: confab fetch {iri} --into {importer.parent}" if web else ""
    remedy = f"put its file beside this one or name it in the catalog{fetch} (nothing is fetched unasked)"
    if alone:
        remedy = "a scene that is given as text can import only shipped ontologies"
    raise KnowledgeError(
        f"{importer}: imports <{iri}>, but neither {beside.name} in its folder nor the shipped catalog contains this IRI; {remedy}"
    )


def _catalog(path: Path) -> Mapping[str, Path]:
    if not path.is_file():
        return {}
    try:
        return ontology.catalog(path)
    except ValueError as error:
        raise KnowledgeError(str(error)) from error
