"""A scene as a SPARQL 1.1 endpoint on loopback, read-only, and the view of what goes on in it.

==============  ==========================================================================================================
``/sparql``     the SPARQL 1.1 protocol: GET, POST of a form, POST of a query; without a query, the service's description
``/``           a page that follows a running execution; ``/view`` is the part of it that changes
==============  ==========================================================================================================

Queries are answered in processes of their own, a few at a time, each within limits (`reasoner.graph.apart`). Who isn't on this
machine isn't answered, whatever name the machine is called by.
"""

from __future__ import annotations

import html
import io
import logging
import queue
import re
import socket
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from string import Template
from time import monotonic
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import pyoxigraph as ox

from confab.table import Table
from reasoner.graph.apart import UNION, Apart, QueryLimits
from reasoner.graph.knowledge import KnowledgeError
from reasoner.limits import LimitError

if TYPE_CHECKING:
    from confab.known import Known
    from confab.live import View
    from planner.acting.executive import Moment

log = logging.getLogger(__name__)
PORT = 7879
AT_ONCE, WAITING, LARGEST = 2, 64, 1_000_000
"""Queries that are answered at once, connections that are open at once, bytes of a request."""
SLOWEST, HURRIED = 20.0, 1.0
"""Seconds that a whole request may take to come: as long as there is a place for others, and when there is none."""
LOOPBACK = re.compile(r"(localhost|127(?:\.\d{1,3}){3}|\[::1\])(:\d+)?", re.IGNORECASE)
ROWS = {
    "application/sparql-results+json": "sparql-json",
    "application/json": "sparql-json",
    "application/sparql-results+xml": "sparql-xml",
    "application/xml": "sparql-xml",
    "text/csv": "sparql-csv",
    "text/tab-separated-values": "tsv",
}
"""What the rows of a SELECT, or the truth of an ASK, are written as: the first where a client wants nothing special."""
TRIPLES = {
    "text/turtle": ox.RdfFormat.TURTLE,
    "application/n-triples": ox.RdfFormat.N_TRIPLES,
    "application/rdf+xml": ox.RdfFormat.RDF_XML,
    "application/ld+json": ox.RdfFormat.JSON_LD,
}
DESCRIPTION = Template("""@prefix sd: <http://www.w3.org/ns/sparql-service-description#> .
@prefix void: <http://rdfs.org/ns/void#> .
[] a sd:Service ; sd:endpoint <$url> ; sd:supportedLanguage sd:SPARQL11Query ; sd:feature sd:UnionDefaultGraph ;
  sd:resultFormat $formats ;
  sd:defaultDataset [ a sd:Dataset ; sd:defaultGraph [ a sd:Graph ; void:triples $triples ] ;
    sd:namedGraph $graphs ] .
""")
FORMATS = (
    "SPARQL_Results_JSON",
    "SPARQL_Results_XML",
    "SPARQL_Results_CSV",
    "SPARQL_Results_TSV",
    "Turtle",
    "N-Triples",
    "RDF_XML",
)
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Confab</title><style>
:root { color-scheme: light dark }
body { font: 16px/1.45 system-ui, sans-serif; max-width: 62rem; margin: 1rem auto; padding: 0 1rem }
ul { list-style: none; padding-left: 1.1rem } code { opacity: .7 } td, th { text-align: left; padding: .1rem .8rem .1rem 0 }
#state { opacity: .7; font-size: .9rem }
</style></head><body><p id="state">connecting …</p><main id="view"></main><script>
const view = document.getElementById("view"), state = document.getElementById("state");
async function look() {
  try {
    const answer = await fetch("/view"), text = await answer.text();
    if (text !== look.last) { view.innerHTML = text; look.last = text; }
    state.textContent = "ask it in SPARQL at " + location.origin + "/sparql";
  } catch { state.textContent = "over: nothing answers any more; this is what was seen last"; }
  setTimeout(look, 400);
}
look();
</script></body></html>
"""


class RefusedError(Exception):
    """A request that isn't answered: an HTTP status, and why in a line."""

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status = status


@dataclass
class Service:
    """What is served: a scene, what is known of it now, and the processes that answer queries about it."""

    scene: Known
    limits: QueryLimits
    view: View
    change: int = 0
    _free: queue.Queue[tuple[int, Apart]] = field(default_factory=queue.Queue)

    def __post_init__(self) -> None:
        for _ in range(AT_ONCE):
            self._free.put((self.change, Apart(self.scene.knowledge, self.limits)))

    def ask(self, query: str, graphs: Sequence[str]) -> tuple[str, Table]:
        """Return what a query answers, on what is known now: ``rows``, ``triples`` or ``truth``, and which.

        Raises
        ------
        RefusedError
            It is no query, goes beyond the limits, or too many others wait.
        """
        try:
            made, apart = self._free.get(timeout=self.limits.seconds + SLOWEST)
        except queue.Empty:
            raise RefusedError(503, "too many queries at once; ask again later") from None
        try:
            if made != self.change:
                apart.close()
                made, apart = self.change, Apart(self.scene.knowledge, self.limits)
            kind, columns, found = apart.ask(query, graphs)
        except KnowledgeError as error:
            raise RefusedError(400, str(error)) from error
        except LimitError as error:
            raise RefusedError(500, str(error)) from error
        finally:
            self._free.put((made, apart))
        if kind == "truth":
            return kind, Table((), (), truth=found)
        return kind, Table(tuple(columns), (), tuple(map(tuple, found)))

    def take(self, moment: Moment) -> None:
        """Take note of what happens in an execution: it is shown, and what was observed can be asked."""
        from reasoner.reading.observed import assert_observed

        self.view.take(moment)
        if self.view.known:
            assert_observed(self.scene.knowledge, self.view.known, self.scene.names)
            self.change += 1

    def close(self) -> None:
        """End the processes."""
        for _ in range(AT_ONCE):
            self._free.get()[1].close()


class Server(ThreadingHTTPServer):
    """A server that keeps no more than so many connections at once."""

    daemon_threads = True
    request_queue_size = 1024  # as many wait for a place; who comes after them would be dropped
    allow_reuse_address = True

    def __init__(self, port: int, service: Service) -> None:
        self.service = service
        self.unfinished: dict[socket.socket, float] = {}  # whose requests are waited for now, and since when
        self._places, self._ends = threading.BoundedSemaphore(WAITING), threading.Event()
        super().__init__(("127.0.0.1", port), Handler)

    @property
    def url(self) -> str:
        """Where the page is; the endpoint is below it."""
        return f"http://127.0.0.1:{self.server_port}/"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread of its own, once there is a place for one more; who is slow, or idle, gives place."""
        while not self._places.acquire(timeout=0.1):
            if self._ends.is_set():
                self.shutdown_request(request)
                return
            for connection, since in list(self.unfinished.items()):
                if monotonic() - since > HURRIED:
                    with suppress(OSError):
                        connection.shutdown(socket.SHUT_RDWR)
        super().process_request(request, client_address)

    def shutdown(self) -> None:
        """End, also while connections wait for a place."""
        self._ends.set()
        super().shutdown()

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer, and give the place back."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Log what went wrong with one connection; the others go on."""
        log.debug("%s: the connection broke", client_address, exc_info=True)


class Incoming(io.RawIOBase):
    """What comes from a connection: all of a request within `SLOWEST` seconds, however slowly its bytes drop in."""

    def __init__(self, connection: socket.socket, server: Server) -> None:
        self.connection, self.server, self.begin = connection, server, monotonic()

    def readable(self) -> bool:
        """Return that it can be read."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Wait for bytes, as long as there is time left for this request."""
        left = self.begin + SLOWEST - monotonic()
        if left <= 0:
            raise TimeoutError(f"the request took more than {SLOWEST:.0f} s to come")
        self.server.unfinished[self.connection] = self.begin
        try:
            self.connection.settimeout(left)
            return self.connection.recv_into(buffer)
        finally:
            del self.server.unfinished[self.connection]
            self.connection.settimeout(SLOWEST)


class Handler(BaseHTTPRequestHandler):
    """The requests of one connection."""

    server: Server
    connection: socket.socket
    protocol_version = "HTTP/1.1"
    server_version = "confab"
    timeout = SLOWEST

    def setup(self) -> None:
        """Begin to read what comes."""
        super().setup()
        self.rfile.close()
        self.incoming = Incoming(self.connection, self.server)
        self.rfile = io.BufferedReader(self.incoming)

    def handle_one_request(self) -> None:
        """Answer the next request; its time begins now."""
        self.incoming.begin = monotonic()
        super().handle_one_request()

    def do_GET(self) -> None:
        """Answer GET."""
        self._answered(self._get)

    do_HEAD = do_GET  # noqa: N815

    def do_POST(self) -> None:
        """Answer POST."""
        self._answered(self._post)

    def do_OPTIONS(self) -> None:
        """Say what may be asked, as browsers want to know."""
        self._answered(lambda: ("", b""))

    def _get(self) -> tuple[str, bytes]:
        parts = urlsplit(self.path)
        if parts.path == "/":
            return "text/html; charset=utf-8", PAGE.encode()
        if parts.path == "/view":
            return "text/html; charset=utf-8", view_html(self.server.service).encode()
        if parts.path != "/sparql":
            raise RefusedError(404, f"nothing is at {parts.path[:80]}; the endpoint is at /sparql")
        fields = _fields(parts.query)
        return self._query(fields) if "query" in fields or "update" in fields else self._description()

    def _post(self) -> tuple[str, bytes]:
        parts = urlsplit(self.path)
        body = self._body()
        if parts.path != "/sparql":
            raise RefusedError(404, f"nothing is at {parts.path[:80]}; the endpoint is at /sparql")
        kind = self.headers.get_content_type()
        if kind == "application/x-www-form-urlencoded":
            return self._query({**_fields(parts.query), **_fields(body)})
        if kind == "application/sparql-query":
            return self._query({**_fields(parts.query), "query": [body]})
        if kind == "application/sparql-update":
            raise RefusedError(403, "this endpoint is only read; updates are refused")
        raise RefusedError(415, "wanted application/sparql-query, or a form with the field query")

    def _body(self) -> str:
        length = self.headers.get("Content-Length", "")
        self.close_connection = True  # until the body is read as it was announced
        if not length.isdecimal():
            raise RefusedError(411, "wanted a Content-Length")
        if int(length) > LARGEST:
            raise RefusedError(413, f"a request has at most {LARGEST:,} bytes")
        try:
            content = self.rfile.read(int(length))
        except TimeoutError as error:
            raise RefusedError(408, str(error)) from error
        if len(content) < int(length):
            raise RefusedError(400, "the request ends before its Content-Length")
        self.close_connection = False
        try:
            return content.decode("utf-8")
        except UnicodeDecodeError as error:
            raise RefusedError(400, f"the request is not UTF-8: {error}") from error

    def _query(self, fields: Mapping[str, list[str]]) -> tuple[str, bytes]:
        if "update" in fields:
            raise RefusedError(403, "this endpoint is only read; updates are refused")
        queries = fields.get("query", [])
        if len(queries) != 1:
            raise RefusedError(400, f"wanted one query, got {len(queries)}")
        graphs = fields.get("default-graph-uri", []) or UNION
        what, table = self.server.service.ask(queries[0], graphs)
        accepted = self.headers.get("Accept", "*/*")
        if what == "triples":
            kind = chosen(accepted, list(TRIPLES))
            found = sorted({ox.Triple(*row) for row in table.terms}, key=str)
            prefixes = self.server.service.scene.knowledge.spoken if kind == "text/turtle" else None
            return kind, ox.serialize(found, format=TRIPLES[kind], prefixes=prefixes) or b""
        kind = chosen(accepted, list(ROWS)[:4] if what == "truth" else list(ROWS))
        return kind, table.standard(ROWS[kind])

    def _description(self) -> tuple[str, bytes]:
        kind = chosen(self.headers.get("Accept", "*/*"), list(TRIPLES))
        store = self.server.service.scene.knowledge.store
        text = DESCRIPTION.substitute(
            url=self.server.url + "sparql",
            triples=len(store),
            formats=", ".join(f"<http://www.w3.org/ns/formats/{name}>" for name in FORMATS),
            graphs=", ".join(
                f"[ a sd:NamedGraph ; sd:name {graph} ]" for graph in sorted(map(str, store.named_graphs()))
            ),
        )
        triples = [quad.triple for quad in ox.parse(text, format=ox.RdfFormat.TURTLE)]
        return kind, ox.serialize(triples, format=TRIPLES[kind]) or b""

    def _answered(self, answer: Callable[[], tuple[str, bytes]]) -> None:
        """Send what a request is answered with, or why it isn't."""
        status = 200
        try:
            if not LOOPBACK.fullmatch(self.headers.get("Host", "localhost")):
                raise RefusedError(421, "this endpoint answers on loopback alone")
            kind, content = answer()
            status = 200 if kind else 204
        except RefusedError as error:
            status, kind, content = error.status, "text/plain; charset=utf-8", f"{error}\n".encode()
        except Exception:
            log.exception("confab: a request couldn't be answered")
            status, kind, content = 500, "text/plain; charset=utf-8", b"a fault of Confab, not yours; see its log\n"
        self.send_response(status)
        origin = urlsplit(self.headers.get("Origin", ""))
        if LOOPBACK.fullmatch(origin.netloc):
            self.send_header("Access-Control-Allow-Origin", f"{origin.scheme}://{origin.netloc}")
            self.send_header("Access-Control-Allow-Methods", "GET, POST, OPTIONS")
            self.send_header("Access-Control-Allow-Headers", "Accept, Content-Type")
        self.send_header("Vary", "Accept, Origin")
        if kind:
            self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Length", str(len(content)))
        if status >= 400:
            self.close_connection = True
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Log a request where somebody looks for it."""
        log.debug(format, *args)


def chosen(accept: str, offered: Sequence[str]) -> str:
    """Return the media type that a client likes best, the first offered of those that it likes equally.

    >>> chosen("text/csv;q=0.5, application/*", ["application/json", "text/csv"]), chosen("*/*", ["a/b", "c/d"])
    ('application/json', 'a/b')
    """
    liked: dict[str, float] = {}
    for part in accept.split(",")[:100]:
        name, *parameters = (word.strip() for word in part.lower().split(";"))
        quality = next((p[2:] for p in parameters if p.startswith("q=")), "1")
        with_number = re.fullmatch(r"[01](\.\d{0,3})?", quality)
        liked[name] = float(quality) if with_number else 0.0
    scores = [
        next((liked[name] for name in (kind, kind.split("/")[0] + "/*", "*/*") if name in liked), 0.0)
        for kind in offered
    ]
    if not any(scores):
        raise RefusedError(406, f"it can be had as {', '.join(offered)}")
    return offered[scores.index(max(scores))]


def view_html(service: Service) -> str:
    """Return what is to be seen now: the execution if there is one, else what holds and what is wanted."""
    if service.view.moment is not None:
        return service.view._repr_html_()
    scene = service.scene
    wanted = {goal.rsplit(" ", 1)[0]: goal.rsplit(" ", 1)[1] for goal in scene.goals}
    rows = "".join(
        f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in (what, value, wanted.get(what, '')))}</tr>"
        for what, value in (fact.rsplit(" ", 1) for fact in scene.facts[:2_000])
    )
    return f"<h1>{html.escape(scene.iri)}</h1><table><tr><th>what</th><th>is</th><th>shall be</th></tr>{rows}</table>"


@contextmanager
def serving(scene: Known, port: int = PORT, limits: QueryLimits | None = None) -> Iterator[Server]:
    """Serve a scene until the end of the block; port 0 is any free one.

    Raises
    ------
    KnowledgeError
        The port is taken, or the scene is at an endpoint already.
    """
    from confab.live import View

    if scene.knowledge.remote:
        raise KnowledgeError(f"{scene.iri} is at an endpoint already; ask that one")
    service = Service(scene, limits or QueryLimits(), View(known=dict(scene.problem.initial)))
    try:
        server = Server(port, service)
    except OSError as error:
        raise KnowledgeError(f"port {port} can't be used ({error.strerror}); give another one (--port)") from error
    thread = threading.Thread(target=server.serve_forever, name="confab-serve", daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        service.close()


def _fields(text: str) -> dict[str, list[str]]:
    try:
        return parse_qs(text, keep_blank_values=True, errors="strict", max_num_fields=100)
    except ValueError as error:
        raise RefusedError(400, f"the fields of the request can't be read: {error}") from error
