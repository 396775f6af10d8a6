"""Learned experience as readable values: rules, orders of goals, methods, and the tallies of their use.

==========  ===================================================================================================
Rule        a behaviour that achieves a kind of goal under some conditions
Order       a kind of goal that is achieved before another kind, where both share individuals
Method      steps that refine a behaviour, over its roles and further ones
GoalKind    the goals of one situation type about individuals of one class
Tally       numbers of times that an item was chosen and worked, was passed over, and failed
Experience  the learned items, with tallies by replica and epoch: grow-only, so that memories merge
==========  ===================================================================================================

Rules, orders, methods and kinds of goals are named by a hash of their content: equal items of two replicas have equal names,
and merging them is a union. The tallies of an item are kept by lifted facts (`Fact`): the empty fact counts the item itself;
other facts count situations of the individuals in its roles. Epoch 0 has the tallies that never age. The later epochs, one for
each episode of a replica, have preferences between individuals (this hand, not that one), whose weight decays with the number
of later episodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

from confab.reasoner.symbols import Condition, ValueCondition
from confab.reasoner.symbols import Fact as Goal

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A behaviour and its terms."""
Fact: TypeAlias = "tuple[str, str]"
"""A question about the individuals in the roles of an item, and the answer; both empty for the item itself."""
ITSELF: Fact = ("", "")


class LearningError(ValueError):
    """The plan isn't applicable in the scene's situation, so nothing can be learned from it."""


def _named(kind: str, said: object) -> str:
    import hashlib  # imported on use: planning without memory needs no names

    return f"{kind}_{hashlib.sha1(repr(said).encode(), usedforsecurity=False).hexdigest()[:16]}"


@dataclass(frozen=True)
class Rule:
    """A behaviour that achieves a goal, over roles; different roles denote different individuals.

    Attributes
    ----------
    goal : ValueCondition
        Its terms are roles (``?cup``) or individuals of the domain.
    asks : tuple of Condition
        Conditions under which the rule applies.
    does : behaviour and terms
    kinds : tuple of (role, class)
    """

    goal: ValueCondition
    asks: tuple[Condition, ...]
    does: Ground
    kinds: tuple[tuple[str, str], ...]

    @cached_property
    def name(self) -> str:
        """The rule's name."""
        return _named("rule", (self.goal, self.asks, self.does, self.kinds))

    @property
    def goals(self) -> GoalKind:
        """The kind of goal that the rule achieves."""
        kinds = dict(self.kinds)
        return GoalKind(self.goal.situation, tuple(kinds.get(term, term) for term in self.goal.arguments))


@dataclass(frozen=True)
class Order:
    """An order between two kinds of goals.

    `first` and `then` are situation types. `shared` has the pairs of positions (0 for the first argument, …, last for the value) at
    which both goals have the same individual.
    """

    first: str
    then: str
    shared: tuple[tuple[int, int], ...]

    @cached_property
    def name(self) -> str:
        """The order's name."""
        return _named("order", (self.first, self.then, self.shared))

    @classmethod
    def of(cls, first: Goal, then: Goal, constants: frozenset[str]) -> Order:
        """Return the order of two goals, with the positions of shared individuals that are no constants."""
        one, other = (*first.symbol.arguments, first.value), (*then.symbol.arguments, then.value)
        shared = [(i, j) for i, a in enumerate(one) for j, b in enumerate(other) if a == b and a not in constants]
        return cls(first.symbol.situation, then.symbol.situation, tuple(shared))

    @property
    def reversed(self) -> Order:
        """The opposite order."""
        return Order(self.then, self.first, tuple(sorted((j, i) for i, j in self.shared)))


@dataclass(frozen=True)
class OpenRole:
    """A role of a method that is no parameter of the refined behaviour.

    `kind` is the class of the parameter that it filled. `source` is the symbol whose value it is at its first use: situation
    type and positions of the arguments. `becomes` is the situation type whose value the individual becomes; a free individual
    is preferred.
    """

    kind: str
    source: tuple[str, tuple[int, ...]] | None
    becomes: str | None


@dataclass(frozen=True)
class Method:
    """Steps that refine a behaviour, over numbered roles: first the `roles` of the behaviour itself, then the `open` ones."""

    behavior: str
    roles: int
    steps: tuple[tuple[str, tuple[int, ...]], ...]
    open: tuple[OpenRole, ...]

    @cached_property
    def name(self) -> str:
        """The method's name."""
        return _named("method", (self.behavior, self.roles, self.steps, self.open))


@dataclass(frozen=True)
class GoalKind:
    """The goals of a situation type about individuals of some classes."""

    situation: str
    classes: tuple[str, ...]

    @cached_property
    def name(self) -> str:
        """The kind's name."""
        return _named("goals", (self.situation, self.classes))


Said: TypeAlias = "Rule | Order | Method | GoalKind"


@dataclass(frozen=True)
class Tally:
    """Numbers of times that a candidate was chosen and succeeded, was passed over, and was chosen but failed."""

    chosen: int = 0
    passed_over: int = 0
    failed: int = 0

    def __add__(self, other: Tally) -> Tally:
        """Return the sum, for different events."""
        return Tally(self.chosen + other.chosen, self.passed_over + other.passed_over, self.failed + other.failed)

    def __or__(self, other: Tally) -> Tally:
        """Return the maximum of each number, for two copies of one counter."""
        return Tally(
            max(self.chosen, other.chosen), max(self.passed_over, other.passed_over), max(self.failed, other.failed)
        )


@dataclass
class Lesson:
    """The lesson of one episode: learned items, and tallies to add; `personal` has the preferences between individuals."""

    said: list[Said] = field(default_factory=list)
    counted: list[tuple[Said, Fact, Tally]] = field(default_factory=list)
    personal: list[tuple[Said, Fact, Tally]] = field(default_factory=list)

    def __iadd__(self, other: Lesson) -> Lesson:
        """Add another lesson of the same episode."""
        self.said += other.said
        self.counted += other.counted
        self.personal += other.personal
        return self


Counts: TypeAlias = "dict[str, dict[Fact, Tally]]"


@dataclass
class Experience:
    """Learned items, with grow-only counters for each replica.

    Parameters
    ----------
    replica : str
        ID of the replica that counts in this memory, unique to one writer.
    episodes : mapping of replica to number
        Number of episodes of each replica.
    said : mapping of name to rule, order, method or kind of goal
    counts : mapping of (replica, epoch) to name to fact to tally
    trusts : set of replica
        Other replicas whose experience is used for planning.
    disabled : set of name
        Learned items that are not used for planning.

    Examples
    --------
    >>> one, two = Experience("one"), Experience("two")
    >>> cups = GoalKind("LOCATION", ("Cup",))
    >>> one.learn(Lesson(counted=[(cups, ITSELF, Tally(1))])); two.learn(Lesson(counted=[(cups, ITSELF, Tally(2))]))
    >>> one.merge(two); one.merge(two)
    >>> one.totals()[cups.name][ITSELF].chosen, sorted(one.episodes.items())
    (3, [('one', 1), ('two', 1)])
    """

    replica: str
    episodes: dict[str, int] = field(default_factory=dict)
    said: dict[str, Said] = field(default_factory=dict)
    counts: dict[tuple[str, int], Counts] = field(default_factory=dict)
    trusts: set[str] = field(default_factory=set)
    disabled: set[str] = field(default_factory=set)

    def learn(self, lesson: Lesson) -> None:
        """Add the lesson of one episode."""
        self.episodes[self.replica] = epoch = self.episodes.get(self.replica, 0) + 1
        self.said.update((one.name, one) for one in lesson.said)
        for at, counted in ((0, lesson.counted), (epoch, lesson.personal)):
            for one, fact, tally in counted:
                self.said.setdefault(one.name, one)
                table = self.counts.setdefault((self.replica, at), {}).setdefault(one.name, {})
                table[fact] = table.get(fact, Tally()) + tally

    def merge(self, other: Experience) -> None:
        """Merge another memory, with the maximum of common counters; the result does not depend on order or repetition."""
        self.said.update(other.said)
        for replica, number in other.episodes.items():
            self.episodes[replica] = max(self.episodes.get(replica, 0), number)
        for who, name, fact, tally in other:
            table = self.counts.setdefault(who, {}).setdefault(name, {})
            table[fact] = table.get(fact, Tally()) | tally

    def totals(self) -> Counts:
        """Return the tallies of epoch 0, summed over all replicas, by name and fact."""
        found: Counts = {}
        for (_, epoch), name, fact, tally in self:
            if epoch == 0:
                table = found.setdefault(name, {})
                table[fact] = table.get(fact, Tally()) + tally
        return found

    def preferences(self, decay: float) -> dict[str, dict[Fact, tuple[float, float]]]:
        """Return the numbers of choices and rejections by name and fact; each later episode multiplies them by `decay`."""
        found: dict[str, dict[Fact, tuple[float, float]]] = {}
        for (replica, epoch), name, fact, tally in self:
            if epoch:
                weight = decay ** (self.episodes.get(replica, epoch) - epoch)
                table = found.setdefault(name, {})
                chosen, passed = table.get(fact, (0.0, 0.0))
                table[fact] = chosen + weight * tally.chosen, passed + weight * (tally.passed_over + tally.failed)
        return found

    def __iter__(self) -> Iterator[tuple[tuple[str, int], str, Fact, Tally]]:
        """Yield every counter: replica and epoch, name of the item, fact, and tally."""
        for who, counts in self.counts.items():
            for name, facts in counts.items():
                for fact, tally in facts.items():
                    yield who, name, fact, tally

    def __len__(self) -> int:
        """Return the number of counters."""
        return sum(len(facts) for counts in self.counts.values() for facts in counts.values())
