"""Reading of robots' interfaces from the graph: the robot's actions with arguments and results, and the fields of its world model.

The vocabulary is the section *Interfaces of robots* of ``ontology/embodiment.ttl``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import pyoxigraph as ox

from confab.reasoner.embodiment.facts import EmbodimentError, rows
from confab.reasoner.names import local_name, nearest

INTERFACES = """
SELECT DISTINCT ?node ?transport ?query ?attempts ?failures WHERE {
  ?node a :Interface ; :transport ?transport .
  OPTIONAL { ?node :sceneQuery ?query } OPTIONAL { ?node :attempts ?attempts } OPTIONAL { ?node :failures ?failures }
} ORDER BY ?node"""
ACTIONS = """
SELECT DISTINCT ?node ?name ?seconds ?behavior WHERE {
  ?interface :action ?node . ?node :actionName ?name ; :carriesOut ?behavior .
  OPTIONAL { ?node :timeLimit ?seconds } FILTER(STR(?interface) = %s)
} ORDER BY ?node ?behavior"""
ARGUMENTS = """
SELECT DISTINCT ?name ?position ?constant WHERE {
  ?action :argument ?node . ?node :argumentName ?name FILTER(STR(?action) = %s)
  OPTIONAL { ?node :constant ?constant }
  OPTIONAL { ?node :takes ?parameter . ?behavior c:parameter ?parameter . FILTER(STR(?behavior) = %s)
             { SELECT ?behavior ?parameter (COUNT(?before) AS ?position) WHERE {
                 ?behavior c:parameter ?parameter . ?parameter c:index ?index .
                 OPTIONAL { ?behavior c:parameter ?before . ?before c:index ?earlier FILTER(?earlier < ?index) }
               } GROUP BY ?behavior ?parameter } }
} ORDER BY ?name"""
ANSWERS = """
SELECT DISTINCT ?status ?success ?code ?situation WHERE {
  ?interface :answer ?node . ?node :status ?status FILTER(STR(?interface) = %s)
  OPTIONAL { ?node :success ?success } OPTIONAL { ?node :code ?code } OPTIONAL { ?node :refutedWhile ?situation }
} ORDER BY ?status ?situation"""
READINGS = """
SELECT DISTINCT ?situation ?field ?absent ?step WHERE {
  ?interface :reading ?node . ?node :reads ?situation ; :field ?field FILTER(STR(?interface) = %s)
  OPTIONAL { ?node :valueIfAbsent ?absent } OPTIONAL { ?node :step ?step }
} ORDER BY ?situation"""
NAMES = "SELECT DISTINCT ?node ?name WHERE { ?node :robotName ?name } ORDER BY ?node ?name"

TIME_LIMIT = 60.0
"""Seconds after which an action without a stated time limit is stopped."""


@dataclass(frozen=True)
class InterfaceCall:
    """A robot's action that executes a behaviour.

    Each argument of the action is a constant, or the position of a parameter of the behaviour.
    """

    action: str
    arguments: Mapping[str, int | str]
    seconds: float = TIME_LIMIT


@dataclass(frozen=True)
class Meaning:
    """The meaning of a result status: success, or a failure code with the situation types that must change before a retry."""

    success: bool
    code: str
    refuted_while: tuple[str, ...] = ()


@dataclass(frozen=True)
class ReadField:
    """A field in the robot's world model that contains the value of a symbol."""

    situation: str
    field: str
    absent: str | None = None
    step: str | None = None


@dataclass(frozen=True)
class Interface:
    """The interface of a robot, with the action for each behaviour and the meanings of result statuses.

    `robot_names` maps individuals to the robot's names for these individuals, if the names are different.
    """

    iri: str
    name: str
    transport: str
    calls: Mapping[str, InterfaceCall]
    meanings: Mapping[str, Meaning]
    readings: tuple[ReadField, ...]
    robot_names: Mapping[str, str] = field(default_factory=dict)
    scene_query: str = ""
    attempts: int | None = None
    failures: int | None = None


def read_interface(store: ox.Store, names: Callable[[str], str], wanted: str) -> Interface:
    """Return the interface with a given name.

    Parameters
    ----------
    store : pyoxigraph.Store
        A store with a scene, or only with an interface, together with the imports.
    names : callable
        A function that returns the short name of an IRI, as used in plans.
    wanted : str
        The local name of the interface.

    Raises
    ------
    EmbodimentError
        The interface doesn't exist, an argument has neither a parameter nor a constant, or a behaviour has two actions.
    """
    found = {local_name(row[0]): row for row in rows(store, INTERFACES)}
    if wanted not in found:
        known = f" (interfaces: {', '.join(found)})" if found else ", and no other interface; let the scene import one"
        raise EmbodimentError(f"no interface '{wanted}'{nearest(wanted, found)}{known}")
    iri, transport, query, attempts, failures = found[wanted]
    calls: dict[str, InterfaceCall] = {}
    for node, action, seconds, behavior in rows(store, ACTIONS % _literal(iri)):
        if names(behavior) in calls:
            raise EmbodimentError(f"{behavior} has two actions of {wanted}; one of them is {node}", node)
        arguments = {
            name: _argument(node, name, position, constant)
            for name, position, constant in rows(store, ARGUMENTS % (_literal(node), _literal(behavior)))
        }
        calls[names(behavior)] = InterfaceCall(action, arguments, float(seconds or TIME_LIMIT))
    meanings: dict[str, Meaning] = {}
    for status, success, code, situation in rows(store, ANSWERS % _literal(iri)):
        known_so_far = meanings[status].refuted_while if status in meanings else ()
        meanings[status] = Meaning(
            success == "true", code or status, (*known_so_far, names(situation)) if situation else known_so_far
        )
    readings = tuple(
        ReadField(names(situation), name, names(absent) if absent else None, step or None)
        for situation, name, absent, step in rows(store, READINGS % _literal(iri))
    )
    renamed = {names(node): name for node, name in rows(store, NAMES)}
    return Interface(
        iri,
        wanted,
        transport,
        calls,
        meanings,
        readings,
        renamed,
        query,
        int(attempts) if attempts else None,
        int(failures) if failures else None,
    )


def _argument(action: str, name: str, position: str, constant: str) -> int | str:
    if position:
        return int(position)
    if constant:
        return constant
    raise EmbodimentError(
        f"the argument {name} of {action} has neither a parameter of the behaviour nor a constant; state e:takes or e:constant",
        action,
    )


def _literal(text: str) -> str:
    return str(ox.Literal(text))
