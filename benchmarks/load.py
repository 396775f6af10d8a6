"""Latency of honest requests to `confab serve`, alone and together with slow, abandoned and malformed requests.

    python -m benchmarks.load        1,000 honest, 300 slow, 500 abandoned and 200 malformed requests in a minute
    python -m benchmarks.load 50     a fiftieth of each number

Honest clients send a short query. Slow clients send the same query, one byte per second. Abandoned clients send a query for a
cross product and disconnect within a second. Malformed requests have broken lines, headers, lengths, hosts or queries.
"""

from __future__ import annotations

import asyncio
import random
import re
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from statistics import median, quantiles
from time import perf_counter
from urllib.parse import quote

HONEST, SLOW, ABANDONED, MALFORMED, SECONDS = 1_000, 300, 500, 200, 60.0
CLIENTS = 8
"""Number of honest clients; each client sends its next query after the response to the last query."""
SHORT = quote("SELECT ?x WHERE { ?x a :Behavior } ORDER BY ?x")
LONG = quote("SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i FILTER(?c != ?d) }")
HOST = "Host: localhost\r\nConnection: close\r\n"
POST = f"POST /sparql HTTP/1.1\r\n{HOST}Content-Type: application/sparql-query\r\n".encode()
MALFORMED_REQUESTS = (
    b"\x00\xff\xfe\r\n\r\n",
    b"GET\r\n\r\n",
    b"GET /sparql HTTP/9.9\r\n\r\n",
    b"GET /" + b"x" * 100_000 + b" HTTP/1.1\r\n\r\n",
    b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 20_000 + b"\r\n",
    *(
        f"GET {target} HTTP/1.1\r\n{HOST}\r\n".encode()
        for target in (
            "http://[bad/sparql",
            "/sparql?query=%ff%00",
            "/sparql?query=SELECT",
            f"/sparql?query={'%7B' * 3_000}",
            "/sparql?default-graph-uri=a%20b&query=ASK%7B%7D",
        )
    ),
    f"GET / HTTP/1.1\r\n{HOST}Origin: http://[bad\r\n\r\n".encode(),
    b"GET / HTTP/1.1\r\nHost: elsewhere.org\r\nConnection: close\r\n\r\n",
    POST + b"Content-Length: -5\r\n\r\n",
    POST + b"Content-Length: " + b"9" * 5_000 + b"\r\n\r\n",
    POST + b"Content-Length: 99999999999\r\n\r\n",
    POST + b"Content-Length: 4\r\n\r\n\xff\xfe\xfd\xfc",
    POST + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n",
    f"DELETE /sparql HTTP/1.1\r\n{HOST}\r\n".encode(),
)


@dataclass
class Load:
    """Requests to a port, with the duration of each honest request, and the number of answers by kind of request."""

    port: int
    seconds: list[float] = field(default_factory=list)
    answers: Counter[tuple[str, str]] = field(default_factory=Counter)

    async def request(self, kind: str, content: bytes, leave: float | None = None, pause: float = 0.0) -> None:
        """Send a request, byte by byte with a `pause`, and record the answer; with `leave`, disconnect after `leave` seconds."""
        begin = perf_counter()
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        try:
            for piece in [content[i : i + 1] for i in range(len(content))] if pause else [content]:
                writer.write(piece)
                await writer.drain()
                await asyncio.sleep(pause)
            said = await asyncio.wait_for(reader.read(), leave)
            match = re.match(rb"HTTP/1\.1 (\d+)", said)
            self.answers[kind, match[1].decode() if match else "dropped"] += 1
        except asyncio.TimeoutError:
            self.answers[kind, "left"] += 1
        except ConnectionError:
            self.answers[kind, "dropped"] += 1
        except asyncio.CancelledError:
            self.answers[kind, "unfinished"] += 1
        finally:
            writer.close()
        if kind == "honest":
            self.seconds.append(perf_counter() - begin)

    async def honest(self, times: int, pause: float) -> None:
        """Send short queries one after another."""
        for _ in range(times):
            await self.request("honest", get(SHORT))
            await asyncio.sleep(pause)

    async def later(self, after: float, kind: str, content: bytes, leave: float | None, pause: float) -> None:
        """Send a request after `after` seconds."""
        await asyncio.sleep(after)
        await self.request(kind, content, leave, pause)

    async def run(self, part: float, beside: bool) -> Load:
        """Send a share of the honest requests, alone or, with `beside`, together with other kinds of requests."""
        draw, seconds = random.Random(0), SECONDS * part
        others = [(SLOW, "slow"), (ABANDONED, "abandoned"), (MALFORMED, "malformed")] if beside else []
        tasks = [
            asyncio.create_task(
                self.later(
                    draw.uniform(0.0, seconds),
                    kind,
                    {"slow": get(SHORT), "abandoned": get(LONG)}.get(kind) or draw.choice(MALFORMED_REQUESTS),
                    draw.uniform(0.05, 1.0) if kind == "abandoned" else 30.0,
                    1.0 if kind == "slow" else 0.0,
                )
            )
            for many, kind in others
            for _ in range(round(many * part))
        ]
        times = round(HONEST * part / CLIENTS)
        await asyncio.gather(*(self.honest(times, seconds / times) for _ in range(CLIENTS)))
        for task in tasks:
            if not task.done():
                task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return self


def get(query: str) -> bytes:
    """Return an HTTP request with a query."""
    return f"GET /sparql?query={query} HTTP/1.1\r\n{HOST}\r\n".encode()


def measured(part: float) -> tuple[Load, Load, str]:
    """Return the results of honest requests alone and together with other kinds of requests, and the server's log."""
    start = "from confab.start import main; main()"
    command = [sys.executable, "-c", start, "serve", "beverage-serving", "--port", "0", "--time-limit", "20"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        found = re.search(r":(\d+)/", server.stdout.readline())
        assert found is not None, server.communicate()[1]
        port = int(found[1])
        try:
            asyncio.run(Load(port).honest(CLIENTS, 0.0))
            quiet = asyncio.run(Load(port).run(part, beside=False))
            loaded = asyncio.run(Load(port).run(part, beside=True))
        finally:
            server.terminate()
        return quiet, loaded, server.communicate()[1]


def main() -> int:
    """Print answers and latencies; return 1 if an honest request had no answer, or if the log has a traceback."""
    part = 1 / float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
    quiet, loaded, said = measured(part)
    print("| requests | times | answered with |\n|---|---|---|")
    for kind in ("honest", "slow", "abandoned", "malformed"):
        answers = {status: times for (which, status), times in sorted(loaded.answers.items()) if which == kind}
        print(f"| {kind} | {sum(answers.values())} | {', '.join(f'{n} × {status}' for status, n in answers.items())} |")
    print("\n| latency of an honest request (ms) | alone | beside the others | ratio |\n|---|---|---|---|")
    for name, of in (("median", median), ("95 %", lambda times: quantiles(times, n=20)[-1]), ("longest", max)):
        one, other = (1_000 * of(load.seconds) for load in (quiet, loaded))
        print(f"| {name} | {one:.1f} | {other:.1f} | {other / one:.1f} |")
    print(f"\nTracebacks: {said.count('Traceback')}; lines in the log: {len(said.splitlines())}")
    answered = loaded.answers["honest", "200"] == quiet.answers["honest", "200"] == len(loaded.seconds)
    return int("Traceback" in said or not answered)


if __name__ == "__main__":
    sys.exit(main())
