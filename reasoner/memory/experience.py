"""Experience as values that people can read: rules, orders of goals, refinements, and how often each proved good.

==========  ===================================================================================================
Rule        a goal of this kind is brought about by this behaviour, where this is so
Order       a goal of one kind is achieved before one of another kind, where both speak of the same individual
Method      a behaviour is refined by these steps, over its roles and others
GoalKind    the goals of one situation type about individuals of one class
Tally       how often something was chosen and did what it should, passed over for another, and in vain
Experience  what was learned, with tallies by replica and epoch: grow-only, so that memories merge
==========  ===================================================================================================

Rules, orders, methods and kinds of goals are named by a hash of what they say: replicas that learned the same mean the same, and
merging them is a union. Beside each of them its tallies are kept by facts (`Fact`): the empty fact counts the thing itself, others
what held of the individuals in its roles. Epoch 0 holds what never ages. The later epochs, one for each episode of a replica, hold
who was preferred to somebody else (this hand, not that one); their weight decays when they are read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

from reasoner.symbols import Condition, ValueCondition
from reasoner.symbols import Fact as Goal

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A behaviour and its terms."""
Fact: TypeAlias = "tuple[str, str]"
"""What is asked of the individuals in the roles of a rule, and the answer; both empty for the thing itself."""
ITSELF: Fact = ("", "")


def _named(kind: str, said: object) -> str:
    import hashlib  # only where something is named: planning without memory needs the values alone

    return f"{kind}_{hashlib.sha1(repr(said).encode(), usedforsecurity=False).hexdigest()[:16]}"


@dataclass(frozen=True)
class Rule:
    """What to do for a goal, over roles; different roles are different individuals.

    Attributes
    ----------
    goal : ValueCondition
        Its terms are roles (``?cup``) or individuals that the domain names.
    asks : tuple of Condition
        What must hold now.
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
        """The kind of goal that the rule is for."""
        kinds = dict(self.kinds)
        return GoalKind(self.goal.situation, tuple(kinds.get(term, term) for term in self.goal.arguments))


@dataclass(frozen=True)
class Order:
    """Two kinds of goals of which one comes first.

    `first` and `then` are situation types, `shared` the places (0 the first argument, … and last the value) of `first` and `then`
    at which both name the same individual; none where they share none.
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
        """Return the order of two goals, by what they share."""
        one, other = (*first.symbol.arguments, first.value), (*then.symbol.arguments, then.value)
        shared = [(i, j) for i, a in enumerate(one) for j, b in enumerate(other) if a == b and a not in constants]
        return cls(first.symbol.situation, then.symbol.situation, tuple(shared))

    @property
    def reversed(self) -> Order:
        """The opposite."""
        return Order(self.then, self.first, tuple(sorted((j, i) for i, j in self.shared)))


@dataclass(frozen=True)
class OpenRole:
    """A role of a method that the refined behaviour doesn't name.

    `kind` is the class of the parameter that it filled; `source` the symbol whose value it is where it is needed first: situation
    type and places of the arguments; `becomes` the situation type of which it becomes a value, so that a free one is wanted.
    """

    kind: str
    source: tuple[str, tuple[int, ...]] | None
    becomes: str | None


@dataclass(frozen=True)
class Method:
    """Steps that refine a behaviour, over roles: places below the number of its own individuals, then `open` ones."""

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
    """How often something was chosen (and worked), passed over for another, and chosen in vain."""

    chosen: int = 0
    passed_over: int = 0
    failed: int = 0

    def __add__(self, other: Tally) -> Tally:
        """Return the sum: both happened."""
        return Tally(self.chosen + other.chosen, self.passed_over + other.passed_over, self.failed + other.failed)

    def __or__(self, other: Tally) -> Tally:
        """Return the greater of each: both tell of the same happenings, one perhaps later."""
        return Tally(
            max(self.chosen, other.chosen), max(self.passed_over, other.passed_over), max(self.failed, other.failed)
        )


@dataclass
class Lesson:
    """What one episode teaches: what it says, and what is to be counted; `personal` is who was preferred."""

    said: list[Said] = field(default_factory=list)
    counted: list[tuple[Said, Fact, Tally]] = field(default_factory=list)
    personal: list[tuple[Said, Fact, Tally]] = field(default_factory=list)

    def __iadd__(self, other: Lesson) -> Lesson:
        """Take in another lesson of the same episode."""
        self.said += other.said
        self.counted += other.counted
        self.personal += other.personal
        return self


Counts: TypeAlias = "dict[str, dict[Fact, Tally]]"


@dataclass
class Experience:
    """What was learned, with counts that only grow, kept apart by who counted.

    Parameters
    ----------
    replica : str
        Who counts here: an ID minted with the memory, never used by two writers.
    episodes : mapping of replica to number
        How many episodes each replica has lived.
    said : mapping of name to rule, order, method or kind of goal
    counts : mapping of (replica, epoch) to name to fact to tally
    trusts : set of replica
        Whose experience may lead beside this replica's own.
    disabled : set of name
        What isn't to be followed, though it was learned.

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
        """Take in the lesson of one episode."""
        self.episodes[self.replica] = epoch = self.episodes.get(self.replica, 0) + 1
        self.said.update((one.name, one) for one in lesson.said)
        for at, counted in ((0, lesson.counted), (epoch, lesson.personal)):
            for one, fact, tally in counted:
                self.said.setdefault(one.name, one)
                table = self.counts.setdefault((self.replica, at), {}).setdefault(one.name, {})
                table[fact] = table.get(fact, Tally()) + tally

    def merge(self, other: Experience) -> None:
        """Take in another memory: of counters that both have, the greater; of the rest, all. In any order, any number of times."""
        self.said.update(other.said)
        for replica, number in other.episodes.items():
            self.episodes[replica] = max(self.episodes.get(replica, 0), number)
        for who, name, fact, tally in other:
            table = self.counts.setdefault(who, {}).setdefault(name, {})
            table[fact] = table.get(fact, Tally()) | tally

    def totals(self) -> Counts:
        """Return the sums over all replicas of what doesn't age, by name and fact."""
        found: Counts = {}
        for (_, epoch), name, fact, tally in self:
            if epoch == 0:
                table = found.setdefault(name, {})
                table[fact] = table.get(fact, Tally()) + tally
        return found

    def preferences(self, decay: float) -> dict[str, dict[Fact, tuple[float, float]]]:
        """Return how often somebody was preferred and not, by name and fact, each episode since weighing `decay` less."""
        found: dict[str, dict[Fact, tuple[float, float]]] = {}
        for (replica, epoch), name, fact, tally in self:
            if epoch:
                weight = decay ** (self.episodes.get(replica, epoch) - epoch)
                table = found.setdefault(name, {})
                chosen, passed = table.get(fact, (0.0, 0.0))
                table[fact] = chosen + weight * tally.chosen, passed + weight * (tally.passed_over + tally.failed)
        return found

    def __iter__(self) -> Iterator[tuple[tuple[str, int], str, Fact, Tally]]:
        """Yield every counter: who counted (replica and epoch), of what, of which fact, and how often."""
        for who, counts in self.counts.items():
            for name, facts in counts.items():
                for fact, tally in facts.items():
                    yield who, name, fact, tally

    def __len__(self) -> int:
        """Return the number of counters."""
        return sum(len(facts) for counts in self.counts.values() for facts in counts.values())
