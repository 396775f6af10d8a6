"""A scene served on loopback: real clients are answered as the SPARQL 1.1 protocol wants it, and nothing they send harms it."""

import http.client
import json
import random
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from time import monotonic, sleep
from urllib.parse import urlencode

import pytest
import rdflib
import urllib3
from rdflib.plugins.stores.sparqlstore import SPARQLStore

import confab
from confab.serving import Server, serving
from reasoner.graph.apart import QueryLimits

CUPS = "SELECT ?cup ?where WHERE { ?cup a k:Cup ; k:location ?where } ORDER BY ?cup"
CUP1 = "https://w3id.org/confab/beverage-serving#cup1"
FORM = "application/x-www-form-urlencoded"


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving(confab.load("beverage-serving"), 0, QueryLimits(seconds=5, rows=5000)) as served:
        yield served


@pytest.fixture
def pool() -> Iterator[urllib3.PoolManager]:
    with urllib3.PoolManager(retries=False) as manager:
        yield manager


def test_the_three_ways_of_the_protocol_have_the_same_answer(server: Server, pool: urllib3.PoolManager) -> None:
    url = server.url + "sparql"
    answers = [
        pool.request("GET", f"{url}?{urlencode({'query': CUPS})}"),
        pool.request("POST", url, body=urlencode({"query": CUPS}), headers={"Content-Type": FORM}),
        pool.request("POST", url, body=CUPS, headers={"Content-Type": "application/sparql-query; charset=utf-8"}),
    ]
    for answer in answers:
        assert answer.status == 200
        assert answer.headers["Content-Type"] == "application/sparql-results+json"
        assert answer.json()["results"]["bindings"][0]["cup"] == {"type": "uri", "value": CUP1}
    assert pool.request("HEAD", f"{url}?{urlencode({'query': CUPS})}").data == b""


@pytest.mark.parametrize(
    ("accept", "kind", "holds"),
    [
        ("application/sparql-results+xml", "application/sparql-results+xml", b"<uri>"),
        ("text/csv", "text/csv", b"cup,where\r\n"),
        ("text/tab-separated-values", "text/tab-separated-values", b"?cup\t?where\n<https"),
        ("text/csv;q=0.1, application/sparql-results+json", "application/sparql-results+json", b'"bindings"'),
        ("text/html, */*;q=0.1", "application/sparql-results+json", b'"bindings"'),
    ],
)
def test_rows_come_in_the_form_that_the_client_likes_best(
    server: Server, pool: urllib3.PoolManager, accept: str, kind: str, holds: bytes
) -> None:
    answer = pool.request("GET", f"{server.url}sparql?{urlencode({'query': CUPS})}", headers={"Accept": accept})
    assert (answer.status, answer.headers["Content-Type"]) == (200, kind)
    assert holds in answer.data


def test_truth_and_triples_are_answered(server: Server, pool: urllib3.PoolManager) -> None:
    asked = pool.request("GET", f"{server.url}sparql?{urlencode({'query': 'ASK { :cup1 a k:Cup }'})}")
    assert asked.json()["boolean"] is True
    built = f"{server.url}sparql?{urlencode({'query': 'CONSTRUCT WHERE { :cup1 ?p ?o }'})}"
    for accept, form in (("*/*", "turtle"), ("application/n-triples", "nt"), ("application/rdf+xml", "xml")):
        answer = pool.request("GET", built, headers={"Accept": accept})
        assert (rdflib.URIRef(CUP1), rdflib.RDFS.label, None) in rdflib.Graph().parse(data=answer.data, format=form)
    assert pool.request("GET", built, headers={"Accept": "text/csv"}).status == 406


def test_without_a_query_it_describes_itself(server: Server, pool: urllib3.PoolManager) -> None:
    answer = pool.request("GET", server.url + "sparql", headers={"Accept": "text/turtle"})
    said = rdflib.Graph().parse(data=answer.data, format="turtle")
    service = rdflib.Namespace("http://www.w3.org/ns/sparql-service-description#")
    assert (None, service.endpoint, rdflib.URIRef(server.url + "sparql")) in said
    assert (None, service.supportedLanguage, service.SPARQL11Query) in said


def test_rdflibs_own_client_is_answered(server: Server) -> None:
    remote = rdflib.Graph(SPARQLStore(server.url + "sparql", returnFormat="json"))
    cup1 = rdflib.URIRef(CUP1)
    assert str(remote.value(cup1, rdflib.RDFS.label)) == "cup 1"
    assert len(list(remote.query("SELECT ?b WHERE { ?b a <https://w3id.org/confab/core#Behavior> }"))) == 12
    assert len(remote) > 500


def test_what_protege_asks_first_is_answered(server: Server, pool: urllib3.PoolManager) -> None:
    asked = """PREFIX rdf: <http://www.w3.org/1999/02/22-rdf-syntax-ns#>
PREFIX owl: <http://www.w3.org/2002/07/owl#>
PREFIX rdfs: <http://www.w3.org/2000/01/rdf-schema#>
PREFIX xsd: <http://www.w3.org/2001/XMLSchema#>
SELECT ?subject ?object
\tWHERE { ?subject rdfs:subClassOf ?object }"""
    for accept in ("application/sparql-results+xml", "application/sparql-results+json"):
        answer = pool.request(
            "POST",
            server.url + "sparql",
            body=urlencode({"query": asked}),
            headers={"Content-Type": FORM, "Accept": accept},
        )
        assert answer.data.count(b"https://w3id.org/confab/tabletop#Bottle") >= 1


def test_our_own_client_plans_at_it(server: Server) -> None:
    there = confab.load(server.url + "sparql", "https://w3id.org/confab/beverage-serving")
    assert there.plan().plan.length == {1: 4, 2: 10, 3: 32}


@pytest.mark.parametrize(
    ("method", "path", "body", "kind", "status"),
    [
        ("GET", "sparql?query=SELEKT", None, None, 400),
        ("GET", "sparql?query=SELECT+*+{}&query=ASK+{}", None, None, 400),
        ("GET", "sparql?query=%ff", None, None, 400),
        ("GET", "sparql?update=CLEAR+ALL", None, None, 403),
        ("POST", "sparql", "update=CLEAR+ALL", FORM, 403),
        ("POST", "sparql", "CLEAR ALL", "application/sparql-update", 403),
        ("POST", "sparql", "INSERT DATA { <a:a> <a:a> <a:a> }", "application/sparql-query", 400),
        ("POST", "sparql", "{}", "application/json", 415),
        ("POST", "sparql", "", FORM, 400),
        ("GET", "nothing", None, None, 404),
        ("PUT", "sparql", "x", "text/turtle", 501),
        ("GET", "sparql?query=SELECT+*+{SERVICE+<http://127.0.0.1:9/>{?a+?b+?c}}", None, None, 400),
        ("GET", "sparql?query=SELECT+*+WHERE{?a+?b+?c.?d+?e+?f}", None, None, 500),
        ("GET", "sparql?query=SELECT+*+" + "{" * 3000 + "}" * 3000, None, None, 400),
    ],
)
def test_what_it_does_not_answer_has_a_status_and_a_line(
    server: Server, pool: urllib3.PoolManager, method: str, path: str, body: str | None, kind: str | None, status: int
) -> None:
    headers = {"Content-Type": kind} if kind else {}
    answer = pool.request(method, server.url + path, body=body, headers=headers)
    assert answer.status == status, answer.data
    if status != 501:
        assert answer.data.count(b"\n") == 1
        assert b"Traceback" not in answer.data


def test_only_this_machine_is_answered(server: Server, pool: urllib3.PoolManager) -> None:
    url = f"{server.url}sparql?{urlencode({'query': CUPS})}"
    assert pool.request("GET", url, headers={"Host": "evil.example"}).status == 421
    near = pool.request("OPTIONS", url, headers={"Origin": "http://localhost:8080"})
    assert (near.status, near.headers["Access-Control-Allow-Origin"]) == (204, "http://localhost:8080")
    far = pool.request("GET", url, headers={"Origin": "https://evil.example"})
    assert "Access-Control-Allow-Origin" not in far.headers


def test_a_thousand_broken_and_crowding_requests_leave_it_alive(server: Server, pool: urllib3.PoolManager) -> None:
    chance, path = random.Random(7), f"/sparql?{urlencode({'query': CUPS})}"
    good = f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    long = b"POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/sparql-query\r\nContent-Length: "

    def broken(number: int) -> None:
        text = bytearray(good)
        for _ in range(chance.randrange(1, 9)):
            text[chance.randrange(len(text))] = chance.randrange(256)
        texts = [
            bytes(text),
            good[: chance.randrange(len(good))],
            long + b"-5\r\n\r\n",
            long + b"99999999\r\n\r\n",
            b"\0" * 400,
        ]
        with socket.socket() as client:
            client.settimeout(20)
            client.connect(("127.0.0.1", server.server_port))
            client.sendall(texts[number % len(texts)])
            client.shutdown(socket.SHUT_WR)
            while client.recv(4096):
                pass

    def whole(_: int) -> int:
        connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=60)
        connection.request("GET", path)
        answer = connection.getresponse()
        answer.read()
        connection.close()
        return answer.status

    with ThreadPoolExecutor(32) as many:
        breaking = [many.submit(broken, number) for number in range(700)]
        asking = [many.submit(whole, number) for number in range(300)]
        for task in breaking:
            error = task.exception()
            assert error is None or isinstance(error, ConnectionError), error
        assert {task.result() for task in asking} == {200}
    assert pool.request("GET", f"{server.url}sparql?{urlencode({'query': CUPS})}").status == 200
    assert threading.active_count() < 120


def test_clients_that_trickle_or_idle_hold_nobody_up(
    monkeypatch: pytest.MonkeyPatch, pool: urllib3.PoolManager
) -> None:
    monkeypatch.setattr("confab.serving.WAITING", 3)
    monkeypatch.setattr("confab.serving.HURRIED", 0.2)
    with serving(confab.load("living-room"), 0) as server:
        slow = [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(9)]
        stop = threading.Event()

        def trickle() -> None:
            while not stop.wait(0.05):
                for connection in slow:
                    with suppress(OSError):
                        connection.send(b"G")

        trickling = threading.Thread(target=trickle)
        trickling.start()
        assert pool.request("GET", server.url, timeout=10.0).status == 200
        stop.set()
        trickling.join()
        for connection in slow:
            connection.close()


@pytest.mark.parametrize("begun", [b"GET / HT", b"POST /sparql HTTP/1.1\r\nContent-Length: 99\r\n\r\n"])
def test_a_request_has_one_time_to_come_in_however_it_trickles(monkeypatch: pytest.MonkeyPatch, begun: bytes) -> None:
    monkeypatch.setattr("confab.serving.SLOWEST", 0.5)
    with (
        serving(confab.load("living-room"), 0) as server,
        socket.create_connection(("127.0.0.1", server.server_port), timeout=10.0) as slow,
    ):
        slow.sendall(begun)
        begin, answer = monotonic(), b""
        with suppress(OSError):
            while monotonic() - begin < 5.0 and b"\n" not in answer:
                slow.send(b"x")
                slow.settimeout(0.1)
                with suppress(TimeoutError):
                    answer += slow.recv(1000)
                    if not answer:
                        break
        assert monotonic() - begin < 5.0
        assert answer == b"" or b" 408 " in answer


def test_it_ends_though_connections_wait_for_a_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("confab.serving.WAITING", 1)
    monkeypatch.setattr("confab.serving.HURRIED", 60.0)
    with serving(confab.load("living-room"), 0) as server:
        waiting = [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(4)]
        sleep(0.2)
    for connection in waiting:
        connection.close()


def test_a_client_follows_a_robot_that_acts(pool: urllib3.PoolManager) -> None:
    scene = confab.load("beverage-serving")
    seen: list[str] = []
    query = "SELECT ?value WHERE { ?fact a c:SituatedObjectInstance ; c:about :cup1 ; c:situationType k:LOCATION ; c:value ?value }"
    with serving(scene, 0) as server:
        assert "cup1 LOCATION" in pool.request("GET", server.url + "view").data.decode()

        def look(moment: object) -> None:
            server.service.take(moment)  # type: ignore[arg-type]
            if getattr(moment, "what", "") == "end" and len(getattr(moment, "done", ())) % 8 == 0:
                answer = pool.request("GET", f"{server.url}sparql?{urlencode({'query': query})}")
                seen.extend(
                    row["value"]["value"].split("#")[1] for row in json.loads(answer.data)["results"]["bindings"]
                )
                assert "primitives" in pool.request("GET", server.url + "view").data.decode()

        assert scene.execute(tell=look).reached
        assert "reached" in pool.request("GET", server.url + "view").data.decode()
    assert seen[-1] == "location7"
