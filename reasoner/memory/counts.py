"""What choosing taught, as counts: which facts held when a behaviour was chosen, and when it was passed over or failed.

==============  =============================================================================================
Conclusion      a behaviour with the class of each of its roles: ``B2_PLACE (Hand, Location, Cup)``
Pattern         the lifted facts that held of one candidate, each with its value
Tally           how often such a candidate was chosen, passed over, and failed
Experience      tallies by replica, epoch, conclusion and pattern: grow-only, so that memories merge
==============  =============================================================================================

Epoch 0 holds what never ages. The later epochs, one for each episode of a replica, hold which individual was preferred where one
could have done as well as another (this hand, not that one); their weight decays when they are read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

Pattern: TypeAlias = "tuple[tuple[str, str], ...]"
"""Lifted facts in a fixed order, each a name (``object goal LOCATION``) and a value."""


@dataclass(frozen=True, order=True)
class Conclusion:
    """A behaviour with the classes of those that fill its roles, the most specific ones."""

    behavior: str
    classes: tuple[str, ...]

    def __str__(self) -> str:
        """Return it as ``B1_MOVE(Cup, Location)``."""
        return f"{self.behavior}({', '.join(self.classes)})"


@dataclass(frozen=True)
class Tally:
    """How often a candidate was chosen (and worked), passed over for another, and chosen in vain."""

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


Tallies: TypeAlias = "dict[Conclusion, dict[Pattern, Tally]]"


@dataclass(frozen=True)
class Candidate:
    """A quantified behaviour as memory sees it: its conclusion, the facts that hold of it, and the individuals in its roles.

    `personal` are the roles in which individuals themselves may be preferred, since there are few: a hand, but not a place.
    """

    conclusion: Conclusion
    pattern: Pattern
    roles: tuple[tuple[str, str], ...] = ()
    personal: tuple[str, ...] = ()


@dataclass(frozen=True)
class Decision:
    """One choice: what was chosen, what else could have been, and whether it worked."""

    chosen: Candidate
    passed_over: tuple[Candidate, ...] = ()
    succeeded: bool = True


@dataclass
class Experience:
    """Counts that only grow, kept apart by who counted.

    Parameters
    ----------
    replica : str
        Who counts here: an ID minted with the memory, never used by two writers.
    episodes : mapping of replica to number
        How many episodes each replica has lived.
    counts : mapping of (replica, epoch) to tallies

    Examples
    --------
    >>> one, two = Experience("one"), Experience("two")
    >>> move = Candidate(Conclusion("MOVE", ("Cup",)), (("object goal LOCATION", "unmet"),))
    >>> one.learn([Decision(move)]); two.learn([Decision(move), Decision(move)])
    >>> one.merge(two); one.merge(two)
    >>> one.totals()[move.conclusion][move.pattern].chosen, sorted(one.episodes.items())
    (3, [('one', 1), ('two', 1)])
    """

    replica: str
    episodes: dict[str, int] = field(default_factory=dict)
    counts: dict[tuple[str, int], Tallies] = field(default_factory=dict)
    trusts: set[str] = field(default_factory=set)

    def learn(self, decisions: Iterable[Decision]) -> None:
        """Count the decisions of one episode.

        What was chosen counts once; of the candidates passed over, every pattern other than the chosen one counts once. Where
        one of them differs in a single, personal role, the individuals are counted besides, in an epoch of their own.
        """
        self.episodes[self.replica] = epoch = self.episodes.get(self.replica, 0) + 1
        for decision in decisions:
            chosen = decision.chosen
            self._count(0, chosen, Tally(chosen=1) if decision.succeeded else Tally(failed=1))
            if not decision.succeeded:
                continue
            for other in {(c.conclusion, c.pattern): c for c in decision.passed_over}.values():
                if (other.conclusion, other.pattern) != (chosen.conclusion, chosen.pattern):
                    self._count(0, other, Tally(passed_over=1))
            for other in decision.passed_over:
                role = _told_apart_by(chosen, other)
                if role is not None:
                    self._count(epoch, _individual(chosen, role), Tally(chosen=1))
                    self._count(epoch, _individual(other, role), Tally(passed_over=1))

    def merge(self, other: Experience) -> None:
        """Take in another memory: of counters that both have, the greater; of the rest, all. In any order, any number of times."""
        for replica, number in other.episodes.items():
            self.episodes[replica] = max(self.episodes.get(replica, 0), number)
        for who, conclusion, pattern, tally in other:
            table = self.counts.setdefault(who, {}).setdefault(conclusion, {})
            table[pattern] = table.get(pattern, Tally()) | tally

    def totals(self) -> Tallies:
        """Return the sums over all replicas of what doesn't age."""
        found: Tallies = {}
        for (_, epoch), conclusion, pattern, tally in self:
            if epoch == 0:
                table = found.setdefault(conclusion, {})
                table[pattern] = table.get(pattern, Tally()) + tally
        return found

    def preferences(self, decay: float) -> dict[Conclusion, dict[Pattern, tuple[float, float]]]:
        """Return how often individuals were preferred and not, each episode since weighing `decay` less.

        The patterns end with the fact which individual it was.
        """
        found: dict[Conclusion, dict[Pattern, tuple[float, float]]] = {}
        for (replica, epoch), conclusion, pattern, tally in self:
            if epoch:
                weight = decay ** (self.episodes.get(replica, epoch) - epoch)
                table = found.setdefault(conclusion, {})
                chosen, passed = table.get(pattern, (0.0, 0.0))
                table[pattern] = chosen + weight * tally.chosen, passed + weight * tally.passed_over
        return found

    def __iter__(self) -> Iterator[tuple[tuple[str, int], Conclusion, Pattern, Tally]]:
        """Yield every counter: who counted (replica and epoch), of what, and how often."""
        for who, tallies in self.counts.items():
            for conclusion, patterns in tallies.items():
                for pattern, tally in patterns.items():
                    yield who, conclusion, pattern, tally

    def __len__(self) -> int:
        """Return the number of counters."""
        return sum(len(patterns) for tallies in self.counts.values() for patterns in tallies.values())

    def _count(self, epoch: int, candidate: Candidate, tally: Tally) -> None:
        table = self.counts.setdefault((self.replica, epoch), {}).setdefault(candidate.conclusion, {})
        table[candidate.pattern] = table.get(candidate.pattern, Tally()) + tally


def _told_apart_by(one: Candidate, other: Candidate) -> str | None:
    """Return the role in which alone two candidates differ, if it is a personal one."""
    if one.conclusion.behavior != other.conclusion.behavior:
        return None
    roles = [a for a, b in zip(one.roles, other.roles, strict=True) if a != b]
    return roles[0][0] if len(roles) == 1 and roles[0][0] in one.personal else None


def _individual(candidate: Candidate, role: str) -> Candidate:
    return Candidate(candidate.conclusion, (*candidate.pattern, (f"{role} is who", dict(candidate.roles)[role])))


def lineage(kind: str, top: str, parents: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Return the classes from `top` down to `kind`; only `kind` and `top` if no chain of superclasses joins them.

    >>> lineage("Mug", "Movable", {"Mug": ("Cup",), "Cup": ("Thing", "Vessel"), "Vessel": ("Movable",)})
    ('Movable', 'Vessel', 'Cup', 'Mug')
    """
    waiting: list[tuple[str, ...]] = [(kind,)]
    seen = {kind}
    while waiting:
        path = waiting.pop(0)
        if path[0] == top:
            return path
        for parent in parents.get(path[0], ()):
            if parent not in seen:
                seen.add(parent)
                waiting.append((parent, *path))
    return (top, kind)
