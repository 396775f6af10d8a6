"""Stores for a scene's triples besides memory: an Oxigraph store on disk, and any SPARQL 1.1 endpoint.

A store on disk is filled from the files when it is created, and again after a file has changed. An endpoint is only read, by a few
large queries. An endpoint contains either all triples in one default graph, or a named graph for each ontology. The name of such a
graph is the ontology's IRI.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlencode, urlsplit, urlunsplit

import pyoxigraph as ox
import urllib3
from urllib3.exceptions import HTTPError, MaxRetryError, ReadTimeoutError, TimeoutError

from confab import ontology
from confab.reasoner.graph.knowledge import (
    BASE,
    Answer,
    KnowledgeError,
    KnowledgeGraph,
    load,
    read_prefixes,
    scene_file,
    text,
)

AUTHORIZATION = "CONFAB_SPARQL_AUTHORIZATION"
"""Environment variable with the value of the HTTP Authorization header, e.g. ``Bearer …``."""
TIMEOUT = 60.0
RETRIES = 3
BACKOFF = 0.2
BUSY = (429, 502, 503, 504)
RESULTS = "application/sparql-results+json"
LARGEST = 2_000_000_000
"""Maximum number of bytes in an HTTP response; a scene of 20,000 objects has 20 million bytes."""
CHUNK = 1 << 16
FORM = re.compile(r"\b(SELECT|ASK|CONSTRUCT|DESCRIBE)\b", re.IGNORECASE)
PROLOGUE = re.compile(r"#[^\n]*|\bPREFIX\s+\S*\s*<[^>]*>|\bBASE\s*<[^>]*>", re.IGNORECASE)
STAMP = "urn:confab:file"
SATELLITES = tuple(f".{kind}" for kind in ontology.SATELLITES)

ONTOLOGIES = """
SELECT DISTINCT ?graph ?ontology ?import WHERE {
  { ?ontology a owl:Ontology . OPTIONAL { ?ontology owl:imports ?import } }
  UNION { GRAPH ?graph { ?ontology a owl:Ontology . OPTIONAL { ?ontology owl:imports ?import } } }
} ORDER BY ?graph ?ontology ?import"""


# ---------------------------------------------------------------------------------------------------------- an endpoint


@dataclass
class RemoteEndpoint:
    """A SPARQL 1.1 endpoint that is queried by POST requests.

    Parameters
    ----------
    url : str
        The endpoint's URL. A user name and password in the URL are sent as basic authentication, and removed from the URL.
    authorization : str, optional
        Value of the Authorization header.
    timeout : float
        Maximum number of seconds to wait for a response.
    retries : int
        Number of retries after a lost connection or for a busy server; the pause doubles with each retry.
    graphs : tuple of str
        IRIs of the named graphs whose union is queried; the endpoint's default graph if empty.

    Attributes
    ----------
    noted : mapping of request to digest of its result
        The requests that `confirm` repeats, each with a digest of its result.
    """

    url: str
    authorization: str | None = field(default=None, repr=False)
    timeout: float = TIMEOUT
    retries: int = RETRIES
    graphs: tuple[str, ...] = ()
    noted: dict[tuple[bytes, str], bytes] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        try:
            parts = urlsplit(self.url)
            ox.NamedNode(self.url)
        except ValueError as error:
            raise KnowledgeError(f"'{self.url}' is no address of an endpoint: {error}") from error
        if parts.username is not None:
            login = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
            self.authorization = self.authorization or urllib3.make_headers(basic_auth=login)["authorization"]
            self.url = urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2]))

    @cached_property
    def _pool(self) -> urllib3.PoolManager:
        retry = urllib3.Retry(
            total=self.retries,
            read=min(1, self.retries),  # a query that timed out is repeated only once
            backoff_factor=BACKOFF,
            status_forcelist=BUSY,
            allowed_methods=None,  # queries change nothing, so POST requests can be repeated
            raise_on_status=False,
            respect_retry_after_header=False,
        )
        return urllib3.PoolManager(
            retries=retry, timeout=urllib3.Timeout(connect=min(5.0, self.timeout), read=self.timeout)
        )

    def query(self, query: str, prefixes: Mapping[str, str], bindings: Mapping[str, str], noted: bool = True) -> Answer:
        """Return the result of a SPARQL 1.1 query.

        Parameters
        ----------
        query : str
        prefixes : mapping of prefix to namespace
        bindings : mapping of variable to IRI
            The values of variables that the query selects.
        noted : bool
            Whether `confirm` repeats the query.

        Raises
        ------
        KnowledgeError
            The server doesn't respond, is too slow, requires authentication or isn't an endpoint; the response is too large; or the
            query isn't SPARQL.
        """
        form = FORM.search(PROLOGUE.sub(" ", query))
        rows = form is None or form.group().upper() in ("SELECT", "ASK")
        accept = RESULTS if rows else "application/n-triples"
        fields = [
            ("query", _complete(query, prefixes, bindings)),
            *(("default-graph-uri", graph) for graph in self.graphs),
        ]
        body = urlencode(fields).encode()
        answer, kind = self._post(body, accept)
        if noted:
            self.noted[body, accept] = _digest(answer)
        try:
            if rows:
                results = ox.QueryResultsFormat.from_media_type(kind) or ox.QueryResultsFormat.JSON
                return ox.parse_query_results(answer, format=results)
            triples = ox.Store()
            triples.load(answer, format=ox.RdfFormat.from_media_type(kind) or ox.RdfFormat.N_TRIPLES)
        except (SyntaxError, ValueError) as error:
            raise KnowledgeError(
                f"{self.url}: the answer, said to be {kind or 'of no media type'}, is no SPARQL 1.1 result ({error}); "
                "is it an endpoint?"
            ) from error
        return triples.query("CONSTRUCT WHERE { ?s ?p ?o }")

    def confirm(self) -> None:
        """Repeat all noted queries, to detect changes of the data during planning.

        Raises
        ------
        KnowledgeError
            The result of a noted query has changed, or `query` fails.
        """
        for (body, accept), digest in self.noted.items():
            if _digest(self._post(body, accept)[0]) != digest:
                raise KnowledgeError(f"{self.url}: the data have changed since they were read; load the scene again")

    def _post(self, body: bytes, accept: str) -> tuple[bytes, str]:
        """Return the content and the media type of the response to a request."""
        headers = {"Accept": accept, "Content-Type": "application/x-www-form-urlencoded"}
        if self.authorization:
            headers["Authorization"] = self.authorization
        slow = f"{self.url}: no answer within {self.timeout:g} s; the store is too slow for this, or the limit too low"
        for again in reversed(range(self.retries + 1)):
            end = time.monotonic() + 2 * self.timeout  # one timeout for the first byte, one timeout for the other bytes
            try:
                response = self._pool.request("POST", self.url, body=body, headers=headers, preload_content=False)
                answer = bytearray()
                while part := response.read1(CHUNK):
                    answer += part
                    if time.monotonic() > end:
                        raise KnowledgeError(slow)
                    if len(answer) > LARGEST:
                        raise KnowledgeError(
                            f"{self.url}: an answer of more than {LARGEST:,} bytes; is it a SPARQL endpoint?"
                        )
                break
            except (MaxRetryError, TimeoutError) as error:
                cause = error.reason if isinstance(error, MaxRetryError) else error
                if isinstance(cause, ReadTimeoutError):
                    raise KnowledgeError(slow) from None
                raise KnowledgeError(
                    f"{self.url}: nothing answers there ({_short(cause)}); is the server running?"
                ) from None
            except HTTPError as error:  # the connection was lost in the middle of an answer
                if not again:
                    raise KnowledgeError(f"{self.url}: {_short(error)}") from None
        if response.status == 200:
            return bytes(answer), response.headers.get("Content-Type", "").partition(";")[0].strip()
        raise KnowledgeError(f"{self.url}: {_refusal(response.status, answer.decode('utf-8', 'replace'))}")


def _digest(answer: bytes) -> bytes:
    """Return a hash of a result that doesn't depend on the order of rows or the names of blank nodes."""
    try:
        said = json.loads(answer)
        rows = said["results"]["bindings"]
    except (ValueError, KeyError, TypeError):
        lines: list[Any] = sorted(re.sub(rb"_:\w+", b"_:", line) for line in answer.splitlines())
        return sha256(b"\n".join(lines)).digest()
    for row in rows:
        for term in row.values():
            if term.get("type") == "bnode":
                term["value"] = ""
    lines = sorted(json.dumps(row, sort_keys=True) for row in rows)
    return sha256("\n".join(lines).encode()).digest()


def connect(url: str, scene: str | None = None, *, timeout: float = TIMEOUT, retries: int = RETRIES) -> KnowledgeGraph:
    """Return the knowledge graph of a scene at a SPARQL 1.1 endpoint, with all its imports that the endpoint contains.

    Parameters
    ----------
    url : str
        URL of the endpoint, e.g. ``http://localhost:7878/query``.
    scene : str, optional
        IRI of the scene; required if the endpoint contains several scenes.
    timeout, retries
        See `RemoteEndpoint`. The Authorization header is read from the environment variable `AUTHORIZATION`.

    Raises
    ------
    KnowledgeError
        A query fails as in `Endpoint.query`, or the endpoint doesn't contain the given scene. If no scene is given, the endpoint
        contains no scene or several scenes.
    """
    endpoint = RemoteEndpoint(url, os.environ.get(AUTHORIZATION), timeout, retries)
    graph = KnowledgeGraph("", remote=endpoint)
    imports: dict[str, set[str]] = {}
    places: dict[str, set[str | None]] = {}
    for where, iri, imported in graph.select(ONTOLOGIES):
        if isinstance(iri, ox.NamedNode):
            imports.setdefault(iri.value, set()).update({text(imported)} if imported else set())
            places.setdefault(iri.value, set()).add(text(where) if where else None)
    graph.scene = _scene(endpoint.url, scene, imports)
    if None not in places[graph.scene]:
        wanted = [graph.scene, f"{graph.scene.rstrip('#/')}.reach"]
        for name in wanted:
            wanted += sorted(imports.get(name, set()) - set(wanted))
        endpoint.graphs = tuple(sorted({place for name in wanted for place in places.get(name, ()) if place}))
    return graph


def _scene(url: str, scene: str | None, imports: Mapping[str, set[str]]) -> str:
    """Return the requested scene; by default, the only ontology that has imports and isn't imported itself."""
    if scene is not None:
        if scene not in imports:
            raise KnowledgeError(
                f"{url}: there is no ontology <{scene}> (there are: {', '.join(sorted(imports)) or 'none'})"
            )
        return scene
    own = {iri: group for iri, group in imports.items() if not iri.endswith(SATELLITES)}
    imported = {iri for group in own.values() for iri in group}
    found = sorted(iri for iri in own if own[iri] and iri not in imported)
    if len(found) != 1:
        what = f"there are several scenes ({', '.join(found)}); choose one (scene=)" if found else "there is no scene"
        raise KnowledgeError(f"{url}: {what}")
    return found[0]


def _complete(query: str, prefixes: Mapping[str, str], bindings: Mapping[str, str]) -> str:
    """Return a query preceded by PREFIX declarations and followed by its bindings as VALUES."""
    head = "\n".join(f"PREFIX {prefix}: {ox.NamedNode(namespace)}" for prefix, namespace in prefixes.items())
    values = f"\nVALUES ({' '.join(f'?{name}' for name in bindings)}) {{ ({_iris(bindings)}) }}" if bindings else ""
    return f"{head}\n{query}{values}"


def _iris(bindings: Mapping[str, str]) -> str:
    return " ".join(str(ox.NamedNode(iri)) for iri in bindings.values())


def _refusal(status: int, message: str) -> str:
    said = f" It says: {message.strip()[:300]}" if message.strip() else ""
    if status == 400:
        return f"the query is not SPARQL 1.1 for this store.{said}"
    if status in (401, 403):
        return f"it wants another authentication (status {status}); set {AUTHORIZATION}, e.g. to 'Bearer …'"
    if status in (404, 405):
        return f"no SPARQL endpoint is there (status {status}); its address often ends in /query or /sparql"
    if status in BUSY:
        return f"the server is busy (status {status}), also after some waiting.{said}"
    return f"the server failed (status {status}).{said}"


def _short(error: object) -> str:
    return re.sub(r"^<[^>]*>: |^\w+\([^)]*\): ", "", str(error)).strip() or type(error).__name__


# -------------------------------------------------------------------------------------------------------------- on disk


def on_disk(source: str | Path, folder: Path) -> KnowledgeGraph:
    """Return a scene in an Oxigraph store on disk, which is filled unless the store contains the current version of all files.

    Parameters
    ----------
    source : str or Path
        Name or file of the scene, as in `confab.reasoner.graph.knowledge.load`.
    folder : Path
        Folder of the store, created if missing. Only one process at a time can use the folder.

    Raises
    ------
    KnowledgeError
        Loading fails as in `confab.reasoner.graph.knowledge.load`, or the folder is in use or isn't a store.
    """
    try:
        store = ox.Store(str(folder))
    except OSError as error:
        raise KnowledgeError(
            f"{folder}: can't be used as a store, perhaps since another process does: {error}"
        ) from error
    path = scene_file(source)
    stamps = ox.NamedNode(STAMP)
    found = {q.subject.value: q.object.value for q in store.quads_for_pattern(None, stamps, None, stamps)}  # type: ignore[union-attr]
    files = {iri: Path(stamp.rsplit("\t", 2)[0]) for iri, stamp in found.items()}
    scene = next((iri for iri, file in files.items() if file == path), None)
    if scene is not None and all(_stamp(file) == found[iri] for iri, file in files.items()):
        graph = KnowledgeGraph(
            scene, store, {scene: path, **{i: f for i, f in files.items() if not i.startswith(BASE)}}
        )
        for file in graph.files.values():
            read_prefixes(graph, file)
        return graph
    store.clear()
    graph = load(path, store)
    reach = path.with_name(f"{path.stem}.reach.ttl")
    stamped = {**graph.files, BASE + "reach": reach}
    store.extend(
        ox.Quad(ox.NamedNode(iri), stamps, ox.Literal(_stamp(file)), stamps) for iri, file in sorted(stamped.items())
    )
    store.flush()
    return graph


def _stamp(file: Path) -> str:
    """Return the path, size and modification time of a file, which together identify its version."""
    if not file.is_file():
        return f"{file}\t0\t0"
    state = file.stat()
    return f"{file}\t{state.st_size}\t{state.st_mtime_ns}"
