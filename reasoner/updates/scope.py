"""Resolution of the variables in an update.

The pattern that introduces a variable determines whether the variable is a term of the behaviour or a number.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
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
    introduces to its class (or situation type), its position and the triple. `numbers` maps each variable that denotes a number
    to the triple or BIND expression that gives the number.
    """

    parts: list[Any] = field(default_factory=list)
    chosen: dict[str, Word] = field(default_factory=dict)
    determined: dict[str, tuple[Word | str, int, Triple]] = field(default_factory=dict)
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
    kinds : mapping of node to (role, class, binder)
        Two different variables that have the same name have two nodes. The binder is "behavior", "witness", or the symbol
        whose value the variable of a nested group denotes.
    prefixes : mapping of prefix to namespace
    numbers : mapping of variable to the triple or expression that gives its number
    several : mapping of variable to a relation, or a property of pairs, whose value it is; such a value determines no variable
    """

    nodes: Nodes
    vocabulary: Vocabulary
    declared: Mapping[str, tuple[str, str, int]]
    terms: dict[str, str] = field(default_factory=dict)
    kinds: dict[str, tuple[str, str, Hashable]] = field(default_factory=dict)
    prefixes: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)
    several: dict[str, Word] = field(default_factory=dict)

    def bind(
        self, name: str, kind: str, role: str, node: str, place: TextPosition, binder: Hashable = "behavior"
    ) -> None:
        """Map a variable to a term node. Two different variables with the same name get different nodes."""
        found, own = self.declared.get(name, ("", "", 0)), (role, kind, binder)
        iri = node or found[0]
        if not iri or (isinstance(binder, tuple) and self.kinds.get(iri, own) != own):
            names = (f"{self.nodes.behavior}.{name[1:]}{'' if n == 1 else f'_{n}'}" for n in count(1))
            iri = next(one for one in names if self.kinds.get(one, own) == own)
        self.kinds.setdefault(iri, own)
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

    def determine(self, group: Group, nested: bool = False) -> None:
        """Map the variables that a group's value conditions introduce to term nodes.

        A variable of a nested group is local. Variables of two nested groups share a node if they denote the value of one symbol.
        """
        waiting = dict(group.determined)
        while waiting:
            free = [name for name, (*_, one) in waiting.items() if not mentioned(subjects_of(one)) & waiting.keys()]
            for name in free or list(waiting):
                kind, at, one = waiting.pop(name)
                symbol = (one.predicate, *(self.terms.get(str(said), said) for said in subjects_of(one)))
                binder = (symbol if free else len(self.kinds),) if nested else "behavior"
                iri = self.iri(kind) if isinstance(kind, Word) else kind
                self.bind(name, iri, "Variable", "", self.nodes.now.place(at), binder)

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
            local = f" here; another {said} is local to its braces" if said in self.terms else ""
            several = self.several.get(said)
            raise UpdateError(
                f"nothing determines the variable {said}{local}"
                + (f", since {several} may have several values" if several else ""),
                f"state its type ({said} a …), or add a situation with "
                + (f"one value at a time and with {said} as" if several else f"{said} as")
                + f" its value (?x :property {said})",
                said.at,
            )
        return self.terms[said]

    def group(self, where: Sequence[Any], known: Collection[str], used: Collection[str] = ()) -> Group:
        """Return the parts of a group graph pattern and the variables that they introduce.

        A pattern that gives a number is a condition if the number occurs neither in another part nor in `used`: the number exists.
        """
        found = self._introduced(where, known)
        for part in found.parts:
            if not isinstance(part, Triple) and part.name == "GroupOrUnionGraphPattern":
                others = {*used, *(name for one in found.parts if one is not part for name in mentioned(one))}
                if shared := sorted(mentioned(part) & others - {*known, *found.names}):
                    at = next(word.at for word in words(part) if word == shared[0])
                    raise UpdateError(
                        f"{shared[0]} occurs in UNION and outside of it", "give it another name in the braces", at
                    )
        read = {*used, *(name for part in found.parts for name in mentioned(part))}
        for name, said in reversed(found.numbers.items()):
            if not isinstance(said, Triple) and name in read:
                read |= mentioned(said)
        found.parts += [one for name, one in found.numbers.items() if isinstance(one, Triple) and name not in read]
        for introduced in (*found.chosen, *found.determined):
            self.numbers.pop(introduced, None)
        self.numbers |= found.numbers
        return found

    def _introduced(self, where: Sequence[Any], known: Collection[str]) -> Group:
        found = Group()
        for part in where:
            if part.name in ("TriplesBlock", "Read"):
                flat = part.triples if part.name == "Read" else [t for block in part.triples for t in triples(block)]
                found.parts += [one for one in flat if not self.begins(one, found, known)]
            elif part.name == "GroupOrUnionGraphPattern" and len(part.graph) == 1:
                inner = self._introduced(parts(part.graph[0]), {*known, *found.names})
                found.parts += inner.parts
                found.chosen |= inner.chosen
                found.determined |= inner.determined
                found.numbers |= inner.numbers
            elif part.name == "Bind":
                own = found.names | mentioned(part.expr)
                if part.var in own or (part.var in known and self.numbers.get(part.var) != part.expr):
                    raise UpdateError(
                        f"BIND gives {part.var} a second value",
                        "use a new variable: BIND(?n - 1 AS ?after)",
                        part.var.at,
                    )
                found.numbers[part.var] = part.expr
            else:
                found.parts.append(part)
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
                    group.determined[subject] = value, subject.at, group.determined[subject][2]
                    return True
            return False
        last = value[-1] if isinstance(value, tuple) and value else value
        if isinstance(last, Word) and last.variable and last not in known and last not in group.names:
            prop = self.iri(one.predicate)
            if self.vocabulary.numeric(prop):
                group.numbers[last] = one
                return True
            if prop in self.vocabulary.functional and prop in self.vocabulary.properties:
                group.determined[last] = self.vocabulary.properties[prop], last.at, one
            elif prop in self.vocabulary.bare:
                group.determined[last] = prop, last.at, one
            elif prop in self.vocabulary.properties or prop in self.vocabulary.relations:
                self.several.setdefault(last, one.predicate)
        return False


def variables_in(one: Triple) -> list[Word]:
    """Return the variables in the subject and object of a triple."""
    said = one.object if isinstance(one.object, tuple) else (one.object,)
    return [word for word in (one.subject, *said) if isinstance(word, Word) and word.variable]


def subjects_of(one: Triple) -> tuple[Said, ...]:
    """Return the terms of a triple without its predicate and its last object."""
    return one.subject, *middle_of(one)


def last_of(one: Triple) -> Said:
    """Return the object of a triple, or its last element if the object is a list."""
    return one.object[-1] if isinstance(one.object, tuple) else one.object


def middle_of(one: Triple) -> tuple[Said, ...]:
    """Return the elements of a triple's object except the last one; return no element if the object isn't a list."""
    return one.object[:-1] if isinstance(one.object, tuple) else ()


def mentioned(part: Any) -> set[str]:
    """Return the variables in a part of a group graph pattern."""
    return {word for word in words(part) if word.variable}
