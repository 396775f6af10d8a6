"""Learned experience: rules, orders of goals and methods, with tallies of their use.

================  ===================================================================================================
LearnedRule       a behaviour that achieves a kind of goal under some conditions
LearnedOrder      a kind of goal that is achieved before another kind, if two such goals share individuals
Method            steps that refine a behaviour, with roles as arguments
GoalKind          the goals of one situation type about individuals of one class
Tally             numbers of times that an item was chosen successfully, was passed over, and failed
MeasuredDuration  durations of a behaviour: number of executions, mean and spread
Experience        all learned items, with grow-only tallies by replica and epoch, which can be merged
================  ===================================================================================================

Rules, orders, methods and kinds of goals are named by a hash of their content. Equal items therefore have equal names in all
replicas, and a union of replicas merges equal items. An item has one tally per `RoleFact`. The tally of the empty fact
counts all uses of the item; the tally of another fact counts only uses in which the individuals in the item's roles satisfied the
fact. The weight of tallies of epoch 0 never decays. Each further epoch belongs to one episode of a replica. The tallies of a
further epoch are preferences between individuals, for example between two hands; their weight decays with every later episode.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt
from typing import TypeAlias

from confab.reasoner.symbols import Condition, ValueCondition
from confab.reasoner.symbols import Fact as Goal

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A behaviour and its arguments."""
RoleFact: TypeAlias = "tuple[str, str]"
"""A question about the individuals in the roles of an item, and the answer. For the tally of all uses of an item, both the question
and the answer are the empty text.
"""
ITSELF: RoleFact = ("", "")


class LearningError(ValueError):
    """Raised if nothing can be learned from a plan, because the plan isn't applicable in the scene's initial state."""


def _named(kind: str, said: object) -> str:
    import hashlib  # imported only for learning, so that Confab starts faster

    return f"{kind}_{hashlib.sha1(repr(said).encode(), usedforsecurity=False).hexdigest()[:16]}"


@dataclass(frozen=True)
class LearnedRule:
    """A behaviour that achieves a goal, with roles as arguments; different roles denote different individuals.

    Attributes
    ----------
    goal : ValueCondition
        The goal, whose terms are roles (``?cup``) or individuals of the domain.
    asks : tuple of Condition
        Conditions under which the rule is applicable.
    does : behaviour and arguments
    kinds : tuple of (role, class)
    """

    goal: ValueCondition
    asks: tuple[Condition, ...]
    does: Ground
    kinds: tuple[tuple[str, str], ...]

    @cached_property
    def name(self) -> str:
        """The hash-based name of the rule."""
        return _named("rule", (self.goal, self.asks, self.does, self.kinds))

    @property
    def goals(self) -> GoalKind:
        """The kind of goal that the rule achieves."""
        kinds = dict(self.kinds)
        return GoalKind(self.goal.situation, tuple(kinds.get(term, term) for term in self.goal.arguments))


@dataclass(frozen=True)
class LearnedOrder:
    """A learned order: goals of one situation type are achieved before goals of another situation type.

    `first` is the situation type of the goals that are achieved first, and `then` is the situation type of the other goals.
    `shared` contains the pairs of positions at which the two goals have the same individual; positions count the arguments from
    0, and the value is last.
    """

    first: str
    then: str
    shared: tuple[tuple[int, int], ...]

    @cached_property
    def name(self) -> str:
        """The hash-based name of the order."""
        return _named("order", (self.first, self.then, self.shared))

    @classmethod
    def of(cls, first: Goal, then: Goal, constants: frozenset[str]) -> LearnedOrder:
        """Return the learned order of two goals.

        The order records the positions of the individuals that both goals contain, except `constants`.
        """
        one, other = (*first.symbol.arguments, first.value), (*then.symbol.arguments, then.value)
        shared = [(i, j) for i, a in enumerate(one) for j, b in enumerate(other) if a == b and a not in constants]
        return cls(first.symbol.situation, then.symbol.situation, tuple(shared))

    @property
    def reversed(self) -> LearnedOrder:
        """The opposite order."""
        return LearnedOrder(self.then, self.first, tuple(sorted((j, i) for i, j in self.shared)))


@dataclass(frozen=True)
class OpenRole:
    """A role of a method that isn't a parameter of the refined behaviour.

    `kind` is the class of the parameter that the role fills. `source` is a symbol whose value fills the role when a step first uses
    the role. The symbol is given by its situation type, and by the roles that are its arguments. If a step makes the individual in
    the role the value of a symbol, `becomes` is the symbol's situation type. Individuals that aren't yet the value of such a symbol
    are then preferred.
    """

    kind: str
    source: tuple[str, tuple[int, ...]] | None
    becomes: str | None


@dataclass(frozen=True)
class Method:
    """Steps that refine a behaviour; their arguments are numbered roles: the behaviour's parameters, then the `open` roles."""

    behavior: str
    roles: int
    steps: tuple[tuple[str, tuple[int, ...]], ...]
    open: tuple[OpenRole, ...]

    @cached_property
    def name(self) -> str:
        """The hash-based name of the method."""
        return _named("method", (self.behavior, self.roles, self.steps, self.open))


@dataclass(frozen=True)
class GoalKind:
    """All goals of a situation type about individuals of some classes."""

    situation: str
    classes: tuple[str, ...]

    @cached_property
    def name(self) -> str:
        """The hash-based name of the kind of goal."""
        return _named("goals", (self.situation, self.classes))


LearnedItem: TypeAlias = "LearnedRule | LearnedOrder | Method | GoalKind"


@dataclass(frozen=True)
class Tally:
    """The numbers of times that a candidate was chosen and succeeded, was passed over, or was chosen but failed."""

    chosen: int = 0
    passed_over: int = 0
    failed: int = 0

    def __add__(self, other: Tally) -> Tally:
        """Return the sum of two tallies, which count different events."""
        return Tally(self.chosen + other.chosen, self.passed_over + other.passed_over, self.failed + other.failed)

    def __or__(self, other: Tally) -> Tally:
        """Return the union of two copies of one tally, which has the greater of each pair of numbers."""
        return Tally(
            max(self.chosen, other.chosen), max(self.passed_over, other.passed_over), max(self.failed, other.failed)
        )


DIGITS = 6
"""Number of decimal places of means and spreads in seconds."""


@dataclass(frozen=True, order=True)
class MeasuredDuration:
    """The measured durations of a behaviour: the number of executions, and the mean and standard deviation in seconds."""

    count: int
    mean: float
    spread: float = 0.0

    @classmethod
    def of(cls, seconds: Sequence[float]) -> MeasuredDuration:
        """Return the statistics of one or more durations.

        >>> MeasuredDuration.of([1.0, 2.0, 3.0])
        MeasuredDuration(count=3, mean=2.0, spread=1.0)
        """
        mean = sum(seconds) / len(seconds)
        squares = sum((one - mean) ** 2 for one in seconds)
        return cls(len(seconds), round(mean, DIGITS), round(sqrt(squares / max(len(seconds) - 1, 1)), DIGITS))

    def __add__(self, other: MeasuredDuration) -> MeasuredDuration:
        """Return the joint statistics of two disjoint sets of executions.

        >>> MeasuredDuration.of([1.0]) + MeasuredDuration.of([2.0, 3.0]) == MeasuredDuration.of([1.0, 2.0, 3.0])
        True
        """
        count, apart = self.count + other.count, other.mean - self.mean
        squares = sum(one.spread**2 * (one.count - 1) for one in (self, other))
        squares += apart**2 * self.count * other.count / count
        mean = self.mean + apart * other.count / count
        return MeasuredDuration(count, round(mean, DIGITS), round(sqrt(squares / (count - 1)), DIGITS))


Statistics: TypeAlias = "Mapping[tuple[str, str], MeasuredDuration]"
"""Measured durations by behaviour and actor; an empty name of the actor stands for all actors."""


def duration_name(key: tuple[str, str]) -> str:
    """Return the hash-based name of the durations of a behaviour and an actor."""
    return _named("duration", key)


@dataclass
class Lesson:
    """The items that were learned in one episode, with their tallies; `personal` contains preferences between individuals."""

    said: list[LearnedItem] = field(default_factory=list)
    counted: list[tuple[LearnedItem, RoleFact, Tally]] = field(default_factory=list)
    personal: list[tuple[LearnedItem, RoleFact, Tally]] = field(default_factory=list)

    def __iadd__(self, other: Lesson) -> Lesson:
        """Add another lesson of the same episode."""
        self.said += other.said
        self.counted += other.counted
        self.personal += other.personal
        return self


Tallies: TypeAlias = "dict[str, dict[RoleFact, Tally]]"


@dataclass
class Experience:
    """Learned items, with grow-only tallies for each replica.

    Parameters
    ----------
    replica : str
        ID of the replica that learns in this memory; only one writer may use the ID.
    episodes : mapping of replica to number
        Number of episodes of each replica.
    said : mapping of name to rule, order, method or kind of goal
    counts : mapping of (replica, epoch) to name to fact to tally
    trusts : set of replica
        Other replicas whose experience is used for planning.
    disabled : set of name
        Learned items that aren't used for planning.
    durations : mapping of replica to (behaviour, actor) to MeasuredDuration

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
    said: dict[str, LearnedItem] = field(default_factory=dict)
    counts: dict[tuple[str, int], Tallies] = field(default_factory=dict)
    trusts: set[str] = field(default_factory=set)
    disabled: set[str] = field(default_factory=set)
    durations: dict[str, dict[tuple[str, str], MeasuredDuration]] = field(default_factory=dict)

    def learn(self, lesson: Lesson) -> None:
        """Add the lesson of one episode."""
        self.episodes[self.replica] = epoch = self.episodes.get(self.replica, 0) + 1
        self.said.update((one.name, one) for one in lesson.said)
        for at, counted in ((0, lesson.counted), (epoch, lesson.personal)):
            for one, fact, tally in counted:
                self.said.setdefault(one.name, one)
                table = self.counts.setdefault((self.replica, at), {}).setdefault(one.name, {})
                table[fact] = table.get(fact, Tally()) + tally

    def measure(self, found: Statistics) -> None:
        """Add measured durations of this replica."""
        self.episodes.setdefault(self.replica, 0)
        own = self.durations.setdefault(self.replica, {})
        own.update({key: own[key] + one if key in own else one for key, one in found.items()})

    def statistics(self, replicas: Collection[str]) -> Statistics:
        """Return the durations that some replicas measured, except disabled durations."""
        found: dict[tuple[str, str], MeasuredDuration] = {}
        for replica, known in self.durations.items():
            for key, one in known.items():
                if replica in replicas and duration_name(key) not in self.disabled:
                    found[key] = found[key] + one if key in found else one
        return found

    def merge(self, other: Experience) -> None:
        """Merge another memory into this one: of two copies of a tally or a statistic, the greater one is kept.

        What either memory disables is disabled. Merges can be repeated, and made in any order.
        """
        self.said.update(other.said)
        self.disabled |= other.disabled
        for replica, number in other.episodes.items():
            self.episodes[replica] = max(self.episodes.get(replica, 0), number)
        for who, name, fact, tally in other:
            table = self.counts.setdefault(who, {}).setdefault(name, {})
            table[fact] = table.get(fact, Tally()) | tally
        for replica, known in other.durations.items():
            mine = self.durations.setdefault(replica, {})
            mine.update({key: max(one, mine.get(key, one)) for key, one in known.items()})

    def totals(self) -> Tallies:
        """Return the tallies of epoch 0, summed over all replicas, by name and fact."""
        found: Tallies = {}
        for (_, epoch), name, fact, tally in self:
            if epoch == 0:
                table = found.setdefault(name, {})
                table[fact] = table.get(fact, Tally()) + tally
        return found

    def preferences(self, decay: float) -> dict[str, dict[RoleFact, tuple[float, float]]]:
        """Return weighted numbers of choices and rejections by name and fact.

        Every later episode multiplies the weights by `decay`.
        """
        found: dict[str, dict[RoleFact, tuple[float, float]]] = {}
        for (replica, epoch), name, fact, tally in self:
            if epoch:
                weight = decay ** (self.episodes.get(replica, epoch) - epoch)
                table = found.setdefault(name, {})
                chosen, passed = table.get(fact, (0.0, 0.0))
                table[fact] = chosen + weight * tally.chosen, passed + weight * (tally.passed_over + tally.failed)
        return found

    def __iter__(self) -> Iterator[tuple[tuple[str, int], str, RoleFact, Tally]]:
        """Yield each tally with its replica and epoch, the name of its item, and its fact."""
        for who, counts in self.counts.items():
            for name, facts in counts.items():
                for fact, tally in facts.items():
                    yield who, name, fact, tally

    def __len__(self) -> int:
        """Return the number of tallies."""
        return sum(len(facts) for counts in self.counts.values() for facts in counts.values())
