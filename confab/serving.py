"""A scene as a page and a read-only SPARQL 1.1 endpoint on loopback (docs/serving.md, docs/page.md).

==============  ==========================================================================================================
``/sparql``     the SPARQL 1.1 protocol (GET, POST of a form, POST of a query); without a query, the service description
``/``           the page (`confab.page`)
``/page.json``  the content of the page about the scene or a running execution (GET), and after changes of controls (POST)
==============  ==========================================================================================================

A GET of ``/page.json?after=VERSION`` is answered with status 204 if no newer version exists.

The libraries uvicorn and starlette serve HTTP. Queries run in separate processes (`confab.reasoner.graph.query_process`). The
processes are divided into lanes with growing time limits. If a query exceeds the limit of a lane, it is started again in the next
lane, which has a lower priority. Because of the lanes, short queries never wait for long queries. A query is cancelled when its
client disconnects. Requests from other machines and from web pages of other sites are refused.
"""

from __future__ import annotations

import asyncio
import json
import logging
import re
import resource
import socket
import threading
from asyncio import LifoQueue, Transport
from collections.abc import Awaitable, Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from math import inf
from pathlib import Path
from string import Template
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import parse_qs

import pyoxigraph as ox
import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from confab.page.frozen import page_html
from confab.page.live import Following
from confab.page.sheet import Sheet, turned_from
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.graph.query_process import QueryLimits, QueryWorker
from confab.reasoner.limits import LimitError
from confab.table import Table

if TYPE_CHECKING:
    from confab.known import Known
    from confab.planner.acting.episode import Event

log = logging.getLogger(__name__)
transport_log = log.getChild("transport")
transport_log.setLevel(logging.CRITICAL + 1)
T = TypeVar("T")
PORT, HIGHEST_PORT = 7879, 65_535
LANES, AT_ONCE = (0.05, 0.5, 5.0, None), 2
"""Time limits of the lanes in seconds, and maximum number of concurrent queries in each lane."""
LARGEST, SLOWEST = 1_000_000, 20.0
"""Maximum size of a request's body in bytes, and maximum time in seconds for receiving a request or sending an answer."""
MOST = min(2_000, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 2)
"""Maximum number of open connections."""
LAST_STATE = 2.0
"""Maximum time in seconds that a server waits before it stops, so that a page can receive the last state of an execution."""
LOOPBACK = r"(localhost|127(\.\d{1,3}){3}|\[::1\])(:\d{1,5})?"
ORIGIN = rf"https?://{LOOPBACK}"
TARGET = re.compile(r"https?://(?P<host>[^/]*)(?P<path>/.*|)", re.IGNORECASE | re.DOTALL)
"""Pattern that separates host and path in the target of an HTTP request."""
SOLUTIONS = {
    "application/sparql-results+json": "sparql-json",
    "application/json": "sparql-json",
    "application/sparql-results+xml": "sparql-xml",
    "application/xml": "sparql-xml",
    "text/csv": "sparql-csv",
    "text/tab-separated-values": "tsv",
}
"""Media types of answers to SELECT queries; the first is the default. Answers to ASK queries have one of the first four types."""
TRIPLES = {
    "text/turtle": ox.RdfFormat.TURTLE,
    "application/n-triples": ox.RdfFormat.N_TRIPLES,
    "application/rdf+xml": ox.RdfFormat.RDF_XML,
    "application/ld+json": ox.RdfFormat.JSON_LD,
}
DESCRIPTION = Path(__file__).with_name("service.ttl")


class Worker:
    """A process that answers queries about the current state of the scene, called from an event loop."""

    def __init__(self, service: Service, nice: int) -> None:
        self.service, self.change = service, 0
        self.process = QueryWorker(service.scene.knowledge, service.limits, nice)
        self.running: asyncio.Future[Any]

    def ready(self) -> None:
        """Start the process if necessary, and wait until it has read the current state of the scene."""
        if self.change != self.service.change:
            self.change = self.service.change
            self.process.close()
        self.process.start()

    async def call(self, function: Callable[..., T], *arguments: object) -> T:
        """Call a function in a thread, and return its result.

        If the caller is cancelled, the query of the process is interrupted.
        """
        future = asyncio.get_running_loop().run_in_executor(self.service.threads, function, *arguments)
        self.running = future
        try:
            return await asyncio.shield(future)
        except asyncio.CancelledError:
            while not future.done():
                self.process.interrupt()
                with suppress(asyncio.CancelledError):  # at a time limit, the client stops waiting
                    await asyncio.wait([future], timeout=0.05)
            future.exception()
            raise

    def return_to(self, lane: LifoQueue[Worker]) -> None:
        """Make the worker available in a lane as soon as its last call has ended, even if the caller hasn't waited for the end."""
        self.running.add_done_callback(lambda _: lane.put_nowait(self))


class Service:
    """A served scene, with the content of the scene's page and the processes that answer queries about the scene."""

    def __init__(self, scene: Known, limits: QueryLimits) -> None:
        self.scene, self.limits, self.change = scene, limits, 0
        self.sheet, self.following = Sheet(scene), Following(scene)
        self.planning = threading.Lock()
        self.page_version, self.page_asked = -1, -inf
        self.lanes: list[LifoQueue[Worker]] = [LifoQueue() for _ in LANES]
        self.workers = [Worker(self, nice=5 * lane) for lane in range(len(LANES)) for _ in range(AT_ONCE)]
        self.threads = ThreadPoolExecutor(len(self.workers))
        for number, worker in enumerate(self.workers):
            self.lanes[number // AT_ONCE].put_nowait(worker)

    async def run(self, work: Callable[[QueryWorker], T]) -> T:
        """Return the result of a query from the first lane whose time limit suffices.

        Raises
        ------
        HTTPException
            The query isn't SPARQL 1.1, or exceeds the limits.
        """
        for seconds, lane in zip(LANES, self.lanes, strict=True):
            worker = await lane.get()
            try:
                await worker.call(worker.ready)
                return await asyncio.wait_for(worker.call(work, worker.process), seconds)
            except asyncio.TimeoutError:
                continue
            except KnowledgeError as error:
                raise HTTPException(400, str(error)) from error
            except LimitError as error:
                raise HTTPException(500, str(error)) from error
            finally:
                worker.return_to(lane)
        raise AssertionError("the last lane has no time limit of its own")

    def take(self, event: Event) -> None:
        """Record an event of an execution for the page, and write the observed facts into the graph for queries."""
        from confab.reasoner.reading.observed import assert_observed

        self.following.take(event)
        names, known = self.scene.names, self.following.known
        # Individuals that were added during execution have no name in the scene.
        strange = {one for symbol in known for one in symbol.arguments if one not in names}
        if known:
            those = {s: v for s, v in known.items() if v not in strange and not strange.intersection(s.arguments)}
            assert_observed(self.scene.knowledge, those, names)
            self.change += 1

    def close(self) -> None:
        """End the processes."""
        for worker in self.workers:
            worker.process.close()
        self.threads.shutdown()
        for worker in self.workers:  # a process may have started after the first loop
            worker.process.close()

    def page_json(self, after: int) -> bytes | None:
        """Return the content of the page about a running execution or the scene; return None if the page has the newest version."""
        self.page_version, self.page_asked = after, monotonic()
        if not self.following.begun:
            return json.dumps(self.sheet.scene_data).encode()
        return None if self.following.version <= after else json.dumps(self.following.data()).encode()

    def wait_for_page(self) -> None:
        """Wait, at most `LAST_STATE` seconds, until a page that follows an execution has received the execution's last state."""
        end = monotonic() + LAST_STATE
        followed = self.following.begun and end - self.page_asked < 2 * LAST_STATE
        while followed and self.page_version < self.following.version and monotonic() < end:
            sleep(0.05)

    def turned_json(self, content: bytes) -> bytes:
        """Return the content of the page after a user's changes; only one plan is made at a time."""
        try:
            turned = turned_from(json.loads(content or b"{}"))
        except (ValueError, RecursionError, KnowledgeError) as error:
            raise HTTPException(400, f"wanted JSON of changed controls: {error}") from error
        with self.planning:
            return json.dumps(self.sheet.answer(turned)).encode()


class RequestFilter:
    """Middleware that refuses requests from other machines and from web pages of other sites."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request to the application, or refuse the request with an HTTP status."""
        headers = Headers(scope=scope)
        host, origin = headers.get("Host", "localhost"), headers.get("Origin", "")
        if named := TARGET.fullmatch(scope["path"]):
            host, scope["path"] = named["host"], named["path"] or "/"
        status, why = 0, ""
        if not scope["path"].startswith("/"):
            status, why = 400, "the request has no path"
        elif not re.fullmatch(LOOPBACK, host, re.IGNORECASE):
            status, why = 421, "this endpoint answers on loopback alone"
        elif not re.fullmatch(ORIGIN, origin) and (origin or headers.get("Sec-Fetch-Site") == "cross-site"):
            status, why = 403, "this endpoint answers no page of another site"
        if status:
            await PlainTextResponse(f"{why}\n", status)(scope, receive, send)
        else:
            await self.app(scope, receive, send)


class Endpoint:
    """The HTTP endpoint of a service: the page, its content, and SPARQL."""

    def __init__(self, service: Service, url: str) -> None:
        self.service, self.url = service, url
        self.app = Starlette(
            routes=[
                Route("/", self.page),
                Route("/page.json", self.data, methods=["GET", "POST"]),
                Route("/sparql", self.sparql, methods=["GET", "POST"]),
            ],
            middleware=[
                Middleware(RequestFilter),
                Middleware(CORSMiddleware, allow_methods=("GET", "POST"), allow_origin_regex=ORIGIN),
            ],
            exception_handlers={HTTPException: refused, Exception: fault},
        )
        self.app.router.redirect_slashes = False

    async def page(self, request: Request) -> Response:
        """Respond with the HTML page, which then requests the content from `/page.json`."""
        return HTMLResponse(page_html(None, "Confab"), headers={"Cache-Control": "no-store"})

    async def data(self, request: Request) -> Response:
        """Respond with the content of the page as JSON."""
        headers = {"Content-Type": "application/json", "Cache-Control": "no-store"}
        if request.method == "POST":
            content = await asyncio.to_thread(self.service.turned_json, await body(request))
            return Response(content, headers=headers)
        after = request.query_params.get("after", "-1")
        if not re.fullmatch(r"-?\d{1,18}", after):
            raise HTTPException(400, f"after is {after[:80]!r}; wanted the version that the page has")
        found = await asyncio.to_thread(self.service.page_json, int(after))
        return Response(status_code=204) if found is None else Response(found, headers=headers)

    async def sparql(self, request: Request) -> Response:
        """Answer a SPARQL query; without a query, respond with the service description."""
        fields = form(request.scope["query_string"])
        if request.method == "POST":
            kind = request.headers.get("Content-Type", "").partition(";")[0].strip().lower()
            content = await body(request)
            if kind == "application/x-www-form-urlencoded":
                fields |= form(content)
            elif kind == "application/sparql-query":
                fields["query"] = [utf8(content)]
            elif kind == "application/sparql-update":
                fields["update"] = [""]
            else:
                raise HTTPException(415, "wanted application/sparql-query, or a form with the field query")
        accept = request.headers.get("Accept", "*/*")
        if "update" in fields:
            raise HTTPException(403, "this endpoint is read-only; it refuses updates")
        if request.method != "POST" and "query" not in fields:
            kind, content = await asyncio.to_thread(self.description, accept)
        else:
            queries = fields.get("query", [])
            if len(queries) != 1:
                raise HTTPException(400, f"wanted one query, got {len(queries)}")
            default, named = fields.get("default-graph-uri", []), fields.get("named-graph-uri", [])
            dataset = (default, named) if default or named else None
            work = partial(self.answer, query=queries[0], dataset=dataset, accept=accept)
            kind, content = await while_connected(request, self.service.run(work))
        return Response(content, headers={"Content-Type": kind, "Cache-Control": "no-store", "Vary": "Accept"})

    def answer(
        self, process: QueryWorker, query: str, dataset: tuple[Sequence[str], Sequence[str]] | None, accept: str
    ) -> tuple[str, bytes]:
        """Return the media type and the text of the answer to a query."""
        what, columns, found = process.ask(query, dataset)
        if what == "triples":
            kind = preferred(accept, list(TRIPLES))
            triples = sorted({ox.Triple(*row) for row in found}, key=str)
            prefixes = self.service.scene.knowledge.spoken if kind == "text/turtle" else None
            return kind, ox.serialize(triples, format=TRIPLES[kind], prefixes=prefixes) or b""
        if what == "truth":
            kind = preferred(accept, list(SOLUTIONS)[:4])
            return kind, Table((), (), truth=found).standard(SOLUTIONS[kind])
        kind = preferred(accept, list(SOLUTIONS))
        return kind, Table(tuple(columns), (), tuple(map(tuple, found))).standard(SOLUTIONS[kind])

    def description(self, accept: str) -> tuple[str, bytes]:
        """Return the media type and the text of the service description."""
        kind, store = preferred(accept, list(TRIPLES)), self.service.scene.knowledge.store
        graphs = ", ".join(f"[ a sd:NamedGraph ; sd:name {name} ]" for name in sorted(map(str, store.named_graphs())))
        text = Template(DESCRIPTION.read_text()).substitute(url=f"{self.url}sparql", triples=len(store), graphs=graphs)
        triples = [quad.triple for quad in ox.parse(text, format=ox.RdfFormat.TURTLE)]
        return kind, ox.serialize(triples, format=TRIPLES[kind]) or b""


async def refused(request: Request, error: Exception) -> Response:
    """Respond to a refused request with a status and one line of text."""
    assert isinstance(error, HTTPException)
    where = f"nothing is at {request.scope['path'][:80]!r}; the endpoint is at /sparql"
    return PlainTextResponse(
        f"{where if error.status_code == 404 else error.detail}\n", error.status_code, error.headers
    )


async def fault(request: Request, error: Exception) -> Response:
    """Respond to a request that has caused a fault of the program."""
    if not isinstance(error, ClientDisconnect):
        log.error("confab: a request couldn't be answered", exc_info=error)
    return PlainTextResponse("a fault of Confab, not yours; see its log\n", 500)


async def while_connected(request: Request, work: Awaitable[T]) -> T:
    """Return the result of a coroutine. If the client disconnects, cancel the coroutine and raise `ClientDisconnect`."""

    async def leaving() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    tasks = asyncio.ensure_future(work), asyncio.ensure_future(leaving())
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        if not tasks[0].done():
            raise ClientDisconnect
        return tasks[0].result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def body(request: Request) -> bytes:
    """Return the body of a request; refuse a body that has more than `LARGEST` bytes or takes more than `SLOWEST` seconds."""

    async def read() -> bytes:
        content = bytearray()
        async for part in request.stream():
            content += part
            if len(content) > LARGEST:
                raise too_large
        return bytes(content)

    close = {"Connection": "close"}
    too_large = HTTPException(413, f"a request has at most {LARGEST:,} bytes", close)
    if int(request.headers.get("Content-Length", "0")) > LARGEST:
        raise too_large
    try:
        return await asyncio.wait_for(read(), SLOWEST)
    except asyncio.TimeoutError:
        raise HTTPException(408, f"the request took more than {SLOWEST:g} s to arrive", close) from None


def form(content: bytes) -> dict[str, list[str]]:
    """Return the fields of an HTML form in a request."""
    try:
        return parse_qs(utf8(content), keep_blank_values=True, errors="strict", max_num_fields=100)
    except ValueError as error:
        raise HTTPException(400, f"the fields of the request can't be read: {error}") from error


def utf8(content: bytes) -> str:
    """Decode bytes as UTF-8; refuse the request if the bytes aren't UTF-8."""
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise HTTPException(400, f"the request is not UTF-8: {error}") from error


def preferred(accept: str, offered: Sequence[str]) -> str:
    """Return the offered media type that an ``Accept`` header prefers; if several are equally preferred, return the first of them.

    >>> preferred("text/csv;q=0.5, application/*", ["application/json", "text/csv"]), preferred("*/*", ["a/b", "c/d"])
    ('application/json', 'a/b')
    """
    quality: dict[str, float] = {}
    for part in accept.split(",")[:100]:
        name, *parameters = (word.strip() for word in part.lower().split(";"))
        given = next((p[2:] for p in parameters if p.startswith("q=")), "1")
        quality[name] = float(given) if re.fullmatch(r"[01](\.\d{0,3})?", given) else 0.0
    scores = [
        next((quality[name] for name in (kind, kind.split("/")[0] + "/*", "*/*") if name in quality), 0.0)
        for kind in offered
    ]
    if not any(scores):
        raise HTTPException(406, f"available media types: {', '.join(offered)}")
    return offered[scores.index(max(scores))]


class Connection(H11Protocol):
    """A connection that is dropped if a request isn't received, or an answer isn't delivered, within `SLOWEST` seconds.

    If more than `MOST` connections are open, the connection that has waited longest for a request is dropped.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.logger, self.access_log = transport_log, False

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        """Start the time limit for the first request; drop another connection if too many are open."""
        super().connection_made(transport)
        self.deadline = self.loop.call_later(SLOWEST, transport.abort)
        if len(self.connections) > MOST:
            waiting = [c for c in self.connections if isinstance(c, Connection) and not c.deadline.cancelled()]
            min(waiting, key=lambda c: c.deadline.when()).transport.abort()

    def handle_events(self) -> None:
        """Handle received data. The time limit ends when the head of a request has been received."""
        before = self.cycle
        super().handle_events()
        if self.cycle is not before and not self.cycle.response_complete:
            self.deadline.cancel()

    def on_response_complete(self) -> None:
        """Start the time limit for the next request."""
        self.deadline.cancel()
        self.deadline = self.loop.call_later(SLOWEST, self.transport.abort)
        super().on_response_complete()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the time limit of a closed connection."""
        self.deadline.cancel()
        super().connection_lost(exc)


class Server(uvicorn.Server):
    """A server in a separate thread, which drops all connections when it stops."""

    def __init__(self, service: Service, listening: socket.socket) -> None:
        self.service, self.listening = service, listening
        self.port: int = listening.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}/"
        app = Endpoint(service, self.url).app
        super().__init__(uvicorn.Config(app, http=Connection, ws="none", lifespan="off", log_config=None))
        self.thread = threading.Thread(target=asyncio.run, args=[self.run_quietly()], name="confab-serve", daemon=True)

    async def run_quietly(self) -> None:
        """Serve until `should_exit` is set; errors of connections are logged for debugging only."""
        asyncio.get_running_loop().set_exception_handler(lambda _, context: transport_log.debug("%s", context))
        await self.serve([self.listening])

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Drop all connections, which cancels their queries."""
        for connection in list(self.server_state.connections):
            connection.transport.abort()
        self.force_exit = True
        await super().shutdown(sockets)


@contextmanager
def serving(scene: Known, port: int = PORT, limits: QueryLimits | None = None) -> Iterator[Server]:
    """Serve a scene on a port until the end of the block; the port 0 selects a free port.

    Raises
    ------
    KnowledgeError
        The port is in use, or the scene is already at an endpoint.
    """
    if scene.knowledge.remote:
        raise KnowledgeError(f"{scene.iri} is at an endpoint already; ask that one")
    if type(port) is not int or not 0 <= port <= HIGHEST_PORT:
        raise KnowledgeError(
            f"port {port!r} is no port; wanted a whole number from 1 to {HIGHEST_PORT}, or 0 for a free port"
        )
    service = Service(scene, limits or QueryLimits())
    try:
        listening = socket.create_server(("127.0.0.1", port), backlog=1024)
    except OSError as error:
        raise KnowledgeError(f"port {port} can't be used ({error.strerror}); give another one (--port)") from error
    server = Server(service, listening)
    server.thread.start()
    try:
        yield server
        service.wait_for_page()
    finally:
        server.should_exit = True
        server.thread.join()
        service.close()
