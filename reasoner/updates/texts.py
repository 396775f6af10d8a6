"""The context of an update: its text with the prefixes of its file, positions, and available properties."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from confab.reasoner.names import local_name

Ask = Callable[[str], Sequence[Sequence[Any]]]
"""Function that returns the rows of a query."""

VOCABULARY = """SELECT DISTINCT ?kind ?term ?other WHERE {
  { ?term a/rdfs:subClassOf* :SituationType . BIND("situation" AS ?kind) OPTIONAL { ?term :valueProperty ?other } }
  UNION { ?other a owl:FunctionalProperty . ?term :valueProperty ?other . BIND("functional" AS ?kind) }
  UNION { ?term a/rdfs:subClassOf* :Relation . BIND("relation" AS ?kind) }
  UNION { ?term a/rdfs:subClassOf* :Amount . BIND("amount" AS ?kind) }
  UNION { ?term a/rdfs:subClassOf* :Relation . BIND("measure" AS ?kind)
    { ?term a owl:DatatypeProperty } UNION { ?term :unit ?unit } UNION { ?fact :relation ?term ; :amount ?number } }
}"""


@dataclass(frozen=True)
class Place:
    """A position in the update of a behaviour; line and column count from 1."""

    behavior: str
    line: int
    column: int
    form: str = "update"

    def __str__(self) -> str:
        """Return the position for a message."""
        of = (
            f"the update of {local_name(self.behavior)}"
            if self.form == "update"
            else f"the rule {local_name(self.behavior)}"
        )
        return f"line {self.line}, column {self.column} of {of}"


@dataclass(frozen=True)
class Update:
    """The text of an update, with the prefixes that its file has."""

    behavior: str
    text: str
    prefixes: Mapping[str, str]

    def place(self, at: int) -> Place:
        """Return the line and column of a character."""
        before = self.text[:at]
        return Place(self.behavior, before.count("\n") + 1, at - (before.rfind("\n") + 1) + 1)


@dataclass(frozen=True)
class Vocabulary:
    """The properties that an update can use, as IRIs.

    `properties` maps a value property to its situation type; `functional` has the properties with one value at a time. `bare`
    has the situation types without a property; their names are used instead. `amounts` has the situation types, and `measures`
    the relations, that give numbers.
    """

    properties: Mapping[str, str]
    functional: Collection[str]
    bare: Collection[str]
    relations: Collection[str]
    amounts: Collection[str]
    measures: Collection[str]

    def numeric(self, prop: str) -> bool:
        """Return whether a property, or a situation type or relation, gives numbers."""
        return prop in self.measures or self.properties.get(prop, prop) in self.amounts

    @classmethod
    def read(cls, ask: Ask) -> Vocabulary:
        """Return the vocabulary of a graph."""
        rows = [[part.value if part is not None else "" for part in row] for row in ask(VOCABULARY)]
        return cls(
            properties={prop: term for kind, term, prop in rows if kind == "situation" and prop},
            functional={prop for kind, _, prop in rows if kind == "functional"},
            bare={term for kind, term, prop in rows if kind == "situation" and not prop},
            relations={term for kind, term, _ in rows if kind == "relation"},
            amounts={term for kind, term, _ in rows if kind == "amount"},
            measures={term for kind, term, _ in rows if kind == "measure"},
        )
