"""A small robot behind HTTP with two rooms and a door, and with its own vocabulary. Faults are planted by a function."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread
from typing import Any

Fault = Callable[[str, dict[str, str]], str]
"""Function that returns the fault of an action: hang, half, lie, refuse, garbage, or an empty text."""

PLACES = {"hall": "hall", "den": "den", "door": "", "shelf_top": "hall", "chest_inside": "den"}
FURNITURE = {"shelf_top": "shelf", "chest_inside": "chest"}


class Robot:
    """The actions of the robot; each action takes effect at once, unless a fault is planted."""

    def __init__(self, fault: Fault = lambda action, arguments: "") -> None:
        self.fault = fault
        self.at, self.room, self.hold = "hall", "hall", ""
        self.open = {"shelf": True, "chest": False, "door": False}
        self.where = {"ball": "shelf_top", "book": "chest_inside"}
        self.cancelled = Event()
        self.called = 0
        self.garbled = False

    def model(self) -> dict[str, Any]:
        ways = {
            f"way.{a}.{b}": {"kind": "way", "begin": a, "end": b, "metres": 2.0}
            for a in ("hall", "den")
            for b in ("hall", "den")
        }
        model: dict[str, Any] = {
            "hall": {"kind": "room", "shape": ["POLYGON ((0 0, 4 0, 4 3, 0 3, 0 0))", "POINT (1 2)"]},
            "den": {"kind": "room"},
            "door": {"kind": "hallway", "open": self.open["door"], "locked": False, "rooms": ["hall", "den"]},
            "rover": {"kind": "robot", "at": self.at, "room": self.room, "battery": 77.7},
        }
        model["rover"] |= {f"{kind}_use": 0.0 for kind in ("navigate", "pick", "place", "open", "close", "detect")}
        for spot, furniture in FURNITURE.items():
            model[furniture] = {"kind": "location", "open": self.open[furniture], "locked": False}
            model[spot] = {"kind": "spot", "location": furniture, "room": PLACES[spot]}
        for thing, place in self.where.items():
            model[thing] = {"kind": "object", "at": place, "may_be_at": []}
        return {**model, **ways}

    def act(self, action: str, arguments: dict[str, str]) -> Any:
        self.called += 1
        self.cancelled.clear()
        wrong = self.fault(action, arguments)
        if wrong == "hang":
            self.cancelled.wait(20.0)
            return {"status": "stopped"}
        if wrong == "half":
            return {"message": "I was about to say"}
        if wrong == "garbage":
            return {"status": "forty-two"}
        if wrong == "refuse":
            return {"status": "no", "message": "I'd rather not"}
        if wrong == "lie":
            return {"status": "yes"}
        return {"status": "yes"} if self._done(action, arguments) else {"status": "no", "message": "that can't be done"}

    def _done(self, action: str, said: dict[str, str]) -> bool:
        if action == "drive":
            if said["side"] != self.room and not self.open["door"]:
                return False
            self.at, self.room = said["to"], said["side"]
        elif action == "grab":
            if self.hold or self.where.get(said["what"]) != self.at or not self.open[FURNITURE[self.at]]:
                return False
            self.hold, self.where[said["what"]] = said["what"], "rover"
        elif action == "drop":
            if not self.hold or self.at not in FURNITURE or not self.open[FURNITURE[self.at]]:
                return False
            self.where[self.hold], self.hold = self.at, ""
        elif action == "turn":
            if self.hold or FURNITURE.get(self.at, self.at) != said["what"]:
                return False
            self.open[said["what"]] = said["how"] == "open"
        else:
            return False
        return True


@contextmanager
def served(robot: Robot) -> Iterator[str]:
    """Serve a robot, and yield its address."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.answer("{" if robot.garbled else json.dumps(robot.model()))

        def do_POST(self) -> None:
            said = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            if self.path == "/cancel":
                robot.cancelled.set()
                self.answer("{}")
            else:
                self.answer(json.dumps(robot.act(said["action"], said["arguments"])))

        def answer(self, text: str) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(text.encode())

        def log_message(self, *_: object) -> None:
            pass

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_: object) -> None:
            pass  # the client has disconnected: the action was cancelled

    server = Server(("127.0.0.1", 0), Handler)
    Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        robot.cancelled.set()
        server.shutdown()
        server.server_close()


def interface(name: str = "rover", seconds: float = 5.0) -> str:
    """Return the robot's interface in Turtle, with its own words for actions, arguments and answers."""

    def argument(action: str, word: str, *parameters: str, constant: str = "") -> str:
        takes = f"e:takes {', '.join('r:' + one for one in parameters)}" if parameters else f'e:constant "{constant}"'
        return f':{action}.{word} a owl:NamedIndividual, e:Argument ; e:argumentName "{word}" ; {takes} .\n'

    def action(node: str, word: str, behaviors: str, arguments: str) -> str:
        return (
            f':{node} a owl:NamedIndividual, e:Action ; e:actionName "{word}" ; e:timeLimit {seconds} ; '
            f"e:carriesOut {', '.join('r:' + one for one in behaviors.split())} ; e:argument {arguments} .\n"
        )

    readings = [("THING_AT", "at"), ("OPEN", "open"), ("DOOR_OPEN", "open"), ("ROBOT_AT", "at"), ("ROBOT_IN", "room")]
    readings += [("BATTERY", "battery")]
    return (
        f"""@prefix : <https://example.org/{name}#> . @prefix r: <https://w3id.org/confab/rooms#> .
@prefix e: <https://w3id.org/confab/embodiment#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .
<https://example.org/{name}> a owl:Ontology ;
  owl:imports <https://w3id.org/confab/embodiment>, <https://w3id.org/confab/rooms> .
:{name} a owl:NamedIndividual, e:Interface ; e:transport "http" ; e:sceneQuery "rooms-from-pyrobosim.rq" ;
  e:attempts 5 ; e:failures 40 ; e:answer :yes, :no, :stopped ;
  e:action :drive, :grab, :drop, :open, :close, :look ;
  e:reading {", ".join(":read_" + situation for situation, _ in readings)} .
:yes a owl:NamedIndividual, e:Answer ; e:status "yes" ; e:success true .
:no a owl:NamedIndividual, e:Answer ; e:status "no" ; e:code "refused" .
:stopped a owl:NamedIndividual, e:Answer ; e:status "stopped" ; e:code "interrupted" .
"""
        + action("drive", "drive", "B2_GO B2_CHARGE", ":drive.to, :drive.side")
        + argument("drive", "to", "B2_GO.place", "B2_CHARGE.charger")
        + argument("drive", "side", "B2_GO.room", "B2_CHARGE.room")
        + action("grab", "grab", "B2_PICK", ":grab.what")
        + argument("grab", "what", "B2_PICK.thing")
        + action("drop", "drop", "B2_PLACE", ":drop.what")
        + argument("drop", "what", "B2_PLACE.thing")
        + action("open", "turn", "B2_OPEN B2_OPEN_DOOR", ":open.what, :open.how")
        + argument("open", "what", "B2_OPEN.furniture", "B2_OPEN_DOOR.door")
        + argument("open", "how", constant="open")
        + action("close", "turn", "B2_CLOSE B2_CLOSE_DOOR", ":close.what, :close.how")
        + argument("close", "what", "B2_CLOSE.furniture", "B2_CLOSE_DOOR.door")
        + argument("close", "how", constant="shut")
        + action("look", "look", "B2_DETECT", ":look.what")
        + argument("look", "what", "B2_DETECT.thing")
        + "".join(
            f':read_{situation} a owl:NamedIndividual, e:Reading ; e:reads r:{situation} ; e:field "{field}" .\n'
            for situation, field in readings
        )
    )
