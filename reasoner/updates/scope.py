"""Resolution of the variables in an update.

The pattern that introduces a variable determines whether the variable is a term of the behaviour or a number.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from confab.reasoner.amounts import written
from confab.reasoner.names import nearest
from confab.reasoner.updates.nodes import Nodes
from confab.reasoner.updates.texts import TextPosition, Vocabulary
from confab.reasoner.updates.words import (
    A,
    NumberLiteral,
    Said,
    Triple,
    Truth,
    UpdateError,
    Word,
    parts,
    triples,
    words,
)
from confab.reasoner.vocabulary import CORE, INDIVIDUAL, TYPE


@dataclass
class Group:
    """The parts of a group graph pattern, without the patterns that only introduce variables.

    `chosen` maps each variable that a type pattern introduces to its class. `determined` maps each variable that a value condition
    introduces to its class (or situation type) and its position. `numbers` maps each variable that denotes a number to the triple
    or BIND expression that gives the number.
    """

    parts: list[Any] = field(default_factory=list)
    chosen: dict[str, Word] = field(default_factory=dict)
    determined: dict[str, tuple[Word | str, int]] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)

    @property
    def names(self) -> set[str]:
        """The variables that the group introduces."""
        return {*self.chosen, *self.determined, *self.numbers}


@dataclass
class VariableScope:
    """The variables of a behaviour or rule.

    Attributes
    ----------
    nodes : Nodes
    vocabulary : Vocabulary
    declared : mapping of variable to (node, class, index)
        The parameters and variables that the file declares outside the update.
    terms : mapping of variable to node
    kinds : mapping of node to (role, class, whether a witness binds it)
        Two different variables that have the same name have two nodes.
    prefixes : mapping of prefix to namespace
    numbers : mapping of variable to the triple or expression that gives its number
    """

    nodes: Nodes
    vocabulary: Vocabulary
    declared: Mapping[str, tuple[str, str, int]]
    terms: dict[str, str] = field(default_factory=dict)
    kinds: dict[str, tuple[str, str, bool]] = field(default_factory=dict)
    prefixes: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)

    def bind(self, name: str, kind: str, role: str, node: str, place: TextPosition, sought: bool = False) -> None:
        """Map a variable to a term node. Two different variables with the same name get different nodes."""
        found = self.declared.get(name, ("", "", 0))
        if not node and found[0]:
            node = found[0]
        for attempt in range(1, 1000):
            iri = node or f"{self.nodes.behavior}.{name[1:]}{'' if attempt == 1 else f'_{attempt}'}"
            if self.kinds.setdefault(iri, (role, kind, sought)) == (role, kind, sought):
                break
        self.terms[name] = iri
        if iri in self.nodes.places:
            return
        self.nodes.places[iri] = place
        if role == "Parameter":
            self.nodes.links["parameter"].append(iri)
        if found[0] != iri:
            self.nodes.said[iri] = {TYPE: [INDIVIDUAL, CORE + role], "termType": [kind]}
            if role == "Parameter":
                self.nodes.said[iri]["index"] = [str(len(self.nodes.links["parameter"]))]

    def determine(self, group: Group) -> None:
        """Map the variables that a group's value conditions introduce to term nodes."""
        for name, (kind, at) in group.determined.items():
            iri = self.iri(kind) if isinstance(kind, Word) else kind
            self.bind(name, iri, "Variable", "", self.nodes.now.place(at))

    def iri(self, word: Word) -> str:
        """Return the IRI of a name in the update."""
        if word.startswith("<"):
            return word[1:-1]
        prefix, _, name = word.partition(":")
        if prefix not in self.prefixes:
            raise UpdateError(
                f"the prefix '{prefix}:' isn't declared{nearest(prefix, self.prefixes)}",
                f"declare it at the top of the file, or write PREFIX {prefix}: <…> before the update",
                word.at,
            )
        return self.prefixes[prefix] + name

    def put(self, said: Said, known: Collection[str], at: int) -> str:
        """Return the node of a variable, or the IRI of an individual or truth value."""
        if isinstance(said, Truth):
            return CORE + ("true" if said.value else "false")
        if isinstance(said, NumberLiteral):
            raise UpdateError(
                f"the number {written(said.value)} is in the place of an individual",
                "name an individual, or use a variable",
                at,
            )
        if not said.variable:
            return self.iri(said)
        if said in self.numbers:
            raise UpdateError(f"{said} is a number in the place of an individual", "name an individual", said.at)
        if said not in known:
            raise UpdateError(
                f"nothing determines the variable {said}",
                f"state its type ({said} a …), or add a situation with {said} as its value (?x :property {said})",
                said.at,
            )
        return self.terms[said]

    def group(self, where: Sequence[Any], known: Collection[str]) -> Group:
        """Return the parts of a group graph pattern and the variables that they introduce."""
        found = Group()
        for part in where:
            if part.name in ("TriplesBlock", "Read"):
                flat = part.triples if part.name == "Read" else [t for block in part.triples for t in triples(block)]
                found.parts += [one for one in flat if not self.begins(one, found, known)]
            elif part.name == "GroupOrUnionGraphPattern" and len(part.graph) == 1:
                inner = self.group(parts(part.graph[0]), {*known, *found.names})
                found.parts += inner.parts
                found.chosen |= inner.chosen
                found.determined |= inner.determined
                found.numbers |= inner.numbers
            elif part.name == "Bind":
                found.numbers[part.var] = part.expr
            else:
                found.parts.append(part)
        self.numbers |= found.numbers
        return found

    def begins(self, one: Triple, group: Group, known: Collection[str]) -> bool:
        """Record the variables that a triple introduces; return True if the triple states no condition."""
        subject, value = one.subject, one.object
        if one.predicate == A:
            if subject.variable and isinstance(value, Word) and not value.variable and subject not in known:
                if subject not in group.names:
                    group.chosen[subject] = value
                    return True
                if subject in group.determined and not isinstance(group.determined[subject][0], Word):
                    group.determined[subject] = value, subject.at
                    return True
            return False
        last = value[-1] if isinstance(value, tuple) and value else value
        if isinstance(last, Word) and last.variable and last not in known and last not in group.names:
            prop = self.iri(one.predicate)
            if self.vocabulary.numeric(prop):
                group.numbers[last] = one
                return True
            if prop in self.vocabulary.functional and prop in self.vocabulary.properties:
                group.determined[last] = self.vocabulary.properties[prop], last.at
            elif prop in self.vocabulary.bare:
                group.determined[last] = prop, last.at
        return False


def variables_in(one: Triple) -> list[Word]:
    """Return the variables in the subject and object of a triple."""
    said = one.object if isinstance(one.object, tuple) else (one.object,)
    return [word for word in (one.subject, *said) if isinstance(word, Word) and word.variable]


def last_of(one: Triple) -> Said:
    """Return the object of a triple, or its last element if the object is a list."""
    return one.object[-1] if isinstance(one.object, tuple) else one.object


def middle_of(one: Triple) -> tuple[Said, ...]:
    """Return the elements of a triple's object except the last one; return no element if the object isn't a list."""
    return one.object[:-1] if isinstance(one.object, tuple) else ()


def mentioned(part: Any) -> set[str]:
    """Return the variables in a part of a group graph pattern."""
    return {word for word in words(part) if word.variable}
