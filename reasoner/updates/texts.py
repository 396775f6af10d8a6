"""The text of an update with its prefixes, the positions in this text, and the properties that an update can use."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from confab.reasoner.names import local_name

Ask = Callable[[str], Sequence[Sequence[Any]]]
"""Function that returns the rows of a SPARQL query."""

VOCABULARY = """SELECT DISTINCT ?kind ?term ?other WHERE {
  { ?term a/rdfs:subClassOf* :SituationType . BIND("situation" AS ?kind) OPTIONAL { ?term :valueProperty ?other } }
  UNION { ?other a owl:FunctionalProperty . ?term :valueProperty ?other . BIND("functional" AS ?kind) }
  UNION { ?term a/rdfs:subClassOf* :Relation . BIND("relation" AS ?kind) }
  UNION { ?term a/rdfs:subClassOf* :Amount . BIND("amount" AS ?kind) }
  UNION { ?term a/rdfs:subClassOf* :Relation . BIND("measure" AS ?kind)
    { ?term a owl:DatatypeProperty } UNION { ?term :unit ?unit } UNION { ?fact :relation ?term ; :amount ?number } }
}"""


@dataclass(frozen=True)
class TextPosition:
    """A position in a behaviour's update or a rule's query; lines and columns are counted from 1."""

    behavior: str
    line: int
    column: int
    form: str = "update"

    def __str__(self) -> str:
        """Return the position as a phrase for messages."""
        of = "the update of" if self.form == "update" else "the rule"
        return f"line {self.line}, column {self.column} of {of} {local_name(self.behavior)}"


@dataclass(frozen=True)
class Update:
    """The text of a behaviour's update, with the prefixes of its file."""

    behavior: str
    text: str
    prefixes: Mapping[str, str]

    def place(self, at: int) -> TextPosition:
        """Return the line and column of the character at an index of the text."""
        before = self.text[:at]
        return TextPosition(self.behavior, before.count("\n") + 1, at - (before.rfind("\n") + 1) + 1)


@dataclass(frozen=True)
class Vocabulary:
    """The IRIs of situation types, relations and properties that an update can use.

    `properties` maps a value property to its situation type. `functional` contains the value properties with one value at a time.
    `bare` contains the situation types without a value property; an update uses their IRIs as predicates. `amounts` contains the
    situation types whose values are numbers. `measures` contains the relations whose values are numbers.
    """

    properties: Mapping[str, str]
    functional: Collection[str]
    bare: Collection[str]
    relations: Collection[str]
    amounts: Collection[str]
    measures: Collection[str]

    def numeric(self, prop: str) -> bool:
        """Return whether the values of a property, situation type or relation are numbers."""
        return prop in self.measures or self.properties.get(prop, prop) in self.amounts

    @classmethod
    def read(cls, ask: Ask) -> Vocabulary:
        """Read the vocabulary of a graph."""
        rows = [[part.value if part is not None else "" for part in row] for row in ask(VOCABULARY)]
        return cls(
            properties={prop: term for kind, term, prop in rows if kind == "situation" and prop},
            functional={prop for kind, _, prop in rows if kind == "functional"},
            bare={term for kind, term, prop in rows if kind == "situation" and not prop},
            relations={term for kind, term, _ in rows if kind == "relation"},
            amounts={term for kind, term, _ in rows if kind == "amount"},
            measures={term for kind, term, _ in rows if kind == "measure"},
        )
