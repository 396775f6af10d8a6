"""A robot behind a server with JSON over HTTP.

========================  ===================================================  ==========================================
request                   body                                                 answer
========================  ===================================================  ==========================================
``GET  {address}/model``                                                       the world model ``{entity: {field: …}}``
``POST {address}/action``  ``{"action": name, "arguments": {name: text}}``     ``{"status": text, "message": text}``, when
                                                                               the action has ended
``POST {address}/cancel``  ``{}``                                              anything, and ``/action`` then answers
========================  ===================================================  ==========================================
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from http.client import HTTPException
from typing import Any
from urllib.error import URLError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

from confab.sim.robots.transport import RobotError, WorldModel

ANSWERS_WITHIN = 5.0
"""Maximum time in seconds until a server answers a request for its world model or a cancellation."""

ACTION_WITHIN = 3600.0
"""Seconds after which the connection of an action is closed. The time limit of the action usually ends the action much earlier."""

MOST_BYTES = 20_000_000
"""Maximum size in bytes of an answer."""


class HttpRobot:
    """A transport (`confab.sim.robots.transport.Transport`) to a server.

    Parameters
    ----------
    where : str
        URL of the server, ``http://…`` or ``https://…``.

    Raises
    ------
    RobotError
        `where` isn't an ``http://…`` or ``https://…`` URL.
    """

    def __init__(self, where: str) -> None:
        address = urlsplit(where)
        if address.scheme not in ("http", "https") or not address.hostname:
            raise RobotError(f"'{where}' is no address of a robot; wanted http://HOST:PORT")
        self.where = where.rstrip("/")

    def call(self, action: str, arguments: Mapping[str, str]) -> tuple[str, str]:
        """Post an action and return the status and message of the answer."""
        said = self._asked("/action", {"action": action, "arguments": dict(arguments)}, ACTION_WITHIN)
        status = said.get("status") if isinstance(said, Mapping) else None
        if not isinstance(status, str):
            raise RobotError(f'{self.where}/action answered {said!r:.60}; wanted {{"status": text}}')
        return status, str(said.get("message") or "")

    def cancel(self) -> None:
        """Request the server to end the running action."""
        self._asked("/cancel", {}, ANSWERS_WITHIN)

    def model(self) -> WorldModel:
        """Return the world model."""
        said = self._asked("/model", None, ANSWERS_WITHIN)
        if not isinstance(said, Mapping):
            raise RobotError(f"{self.where}/model answered {said!r:.60}; wanted a JSON object of entities")
        return said

    def _asked(self, path: str, body: Mapping[str, Any] | None, seconds: float) -> Any:
        data = None if body is None else json.dumps(body).encode()
        request = Request(self.where + path, data, {"Content-Type": "application/json"})
        try:
            with urlopen(request, timeout=seconds) as response:
                text = response.read(MOST_BYTES + 1)
        except (URLError, HTTPException, OSError) as error:
            raise RobotError(f"{self.where}{path}: no answer ({getattr(error, 'reason', None) or error})") from error
        if len(text) > MOST_BYTES:
            raise RobotError(f"{self.where}{path}: the answer has more than {MOST_BYTES} bytes")
        try:
            return json.loads(text)
        except (ValueError, RecursionError) as error:
            raise RobotError(f"{self.where}{path}: the answer is no JSON ({error})") from error
