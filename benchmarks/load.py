"""A thousand connections at once to `confab serve`, whole and malformed: each is answered, refused or dropped, and it lives on.

    python -m benchmarks.load        1,000 at once, as docs/promises.md quotes them
    python -m benchmarks.load 200    so many

All are open before the first has an answer. What is malformed has a broken line, header, length or query; what is endless stops
within its header, and what is slow sends a byte of it a second.
"""

from __future__ import annotations

import asyncio
import random
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter
from urllib.parse import quote

import confab
from confab.serving import serving
from reasoner.graph.apart import QueryLimits

QUERY = quote("SELECT ?x WHERE { ?x a :Behavior } ORDER BY ?x")
WHOLE = f"GET /sparql?query={QUERY} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode()
POST = b"POST /sparql HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: application/sparql-query\r\n"
MALFORMED = (
    b"\x00\xff\xfe\r\n\r\n",
    b"GET\r\n\r\n",
    b"GET /sparql HTTP/9.9\r\n\r\n",
    b"GET /" + b"x" * 100_000 + b" HTTP/1.1\r\n\r\n",
    b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 1_000 + b"\r\n",
    b"GET /sparql?query=%ff%00 HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n",
    b"GET /sparql?query=SELECT HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n",
    b"GET /sparql?query=" + b"%7B" * 3_000 + b" HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: elsewhere.org\r\nConnection: close\r\n\r\n",
    POST + b"Content-Length: -5\r\n\r\n",
    POST + b"Content-Length: 99999999999\r\n\r\n",
    POST + b"Content-Length: 7\r\n\r\nASK",
    POST + b"Content-Length: 4\r\n\r\n\xff\xfe\xfd\xfc",
    POST + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n",
    b"DELETE /sparql HTTP/1.1\r\nHost: localhost\r\n\r\n",
)
KINDS = ("whole", "malformed", "endless", "slow")
PATIENCE = 300.0


class Gate:
    """Opens when so many have come to it."""

    def __init__(self, many: int) -> None:
        self.missing, self.open = many, asyncio.Event()

    async def wait(self) -> None:
        """Come to it, and wait until it opens."""
        self.missing -= 1
        if not self.missing:
            self.open.set()
        await self.open.wait()


async def asked(port: int, request: bytes, all_open: Gate, kind: str) -> tuple[str, bytes]:
    """Open a connection, wait for all others, send a request; return how it was answered, and with what."""
    try:
        reader, writer = await asyncio.wait_for(asyncio.open_connection("127.0.0.1", port), PATIENCE)
    except OSError as error:
        await all_open.wait()
        return type(error).__name__, b""
    try:
        await all_open.wait()
        for piece in (request,) if kind != "slow" else (request[i : i + 1] for i in range(len(request))):
            writer.write(piece)
            await writer.drain()
            if kind == "slow":
                await asyncio.sleep(1.0)
        if kind == "malformed":
            writer.write_eof()
        answer = await asyncio.wait_for(reader.read(), PATIENCE)
    except (ConnectionError, OSError):
        return "dropped", b""
    except asyncio.TimeoutError:
        return "no end", b""
    finally:
        writer.close()
    head, _, body = answer.partition(b"\r\n\r\n")
    return (head.split()[1].decode("ascii", "replace") if head.startswith(b"HTTP/1") else "dropped"), body


async def crowd(port: int, many: int) -> list[tuple[str, str, bytes]]:
    """Send so many requests at once, half of them whole; return of each what it was and how it was answered."""
    draw, all_open = random.Random(0), Gate(many)
    kinds = [draw.choice(KINDS) if draw.random() < 0.5 else "whole" for _ in range(many)]
    requests = [
        draw.choice(MALFORMED) if kind == "malformed" else WHOLE[:-9] if kind == "endless" else WHOLE for kind in kinds
    ]
    answers = await asyncio.gather(
        *(asked(port, request, all_open, kind) for kind, request in zip(kinds, requests, strict=True))
    )
    return [(kind, *answer) for kind, answer in zip(kinds, answers, strict=True)]


def main() -> int:
    """Print how many were answered in which way; return 1 if a whole one wasn't, or the server doesn't live on."""
    many = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000
    with serving(confab.load("beverage-serving"), 0, QueryLimits(seconds=5, rows=5000)) as server:
        threads, begin = len(list(Path("/proc/self/task").iterdir())), perf_counter()
        found = asyncio.run(crowd(server.server_port, many))
        seconds = perf_counter() - begin
        after = asyncio.run(crowd(server.server_port, 1))[0]
        left = len(list(Path("/proc/self/task").iterdir())) - threads
    print("| requests | at once | answered with |\n|---|---|---|")
    for kind in KINDS:
        said = Counter(status for which, status, _ in found if which == kind)
        print(
            f"| {kind} | {said.total()} | {', '.join(f'{times} × {status}' for status, times in sorted(said.items()))} |"
        )
    bodies = {body for kind, status, body in found if kind == "whole" and status == "200"}
    wrong = [status for kind, status, _ in found if kind == "whole" and status != "200"]
    print(
        f"\n{seconds:.0f} s; {len(bodies)} different answer to the one query; afterwards {after[1]}, {left} threads more",
        file=sys.stderr,
    )
    return int(bool(wrong) or len(bodies) != 1 or after[1] != "200")


if __name__ == "__main__":
    sys.exit(main())
