"""Counts never decrease: a merge adds counts, in any order and any number of times."""

from copy import deepcopy

from hypothesis import given
from hypothesis import strategies as st

from confab.reasoner.memory.experience import ITSELF, Experience, GoalKind, LearnedOrder, Lesson, Tally

things = st.sampled_from(
    [GoalKind("LOCATION", ("Cup",)), GoalKind("BEVERAGE", ("Cup",)), LearnedOrder("A", "B", ((0, 0),))]
)
facts = st.sampled_from([ITSELF, ("cup is a Bowl", "yes"), ("cup is a Bowl", "no"), ("who is hand", "left_hand")])
tallies = st.builds(Tally, *[st.integers(0, 2)] * 3)
counted = st.lists(st.tuples(things, facts, tallies), max_size=3)
histories = st.lists(st.builds(Lesson, st.lists(things, max_size=2), counted, counted), max_size=3)


def lived(replica: str, history: list[Lesson]) -> Experience:
    found = Experience(replica)
    for episode in history:
        found.learn(episode)
    return found


def merged(*experiences: Experience) -> Experience:
    found = Experience("merged")
    for experience in experiences:
        found.merge(experience)
    return found


@given(histories, histories, histories)
def test_merging_is_commutative_associative_and_idempotent(a: object, b: object, c: object) -> None:
    one, two, three = lived("one", a), lived("two", b), lived("three", c)  # type: ignore[arg-type]
    assert merged(one, two) == merged(two, one)
    assert merged(merged(one, two), three) == merged(one, merged(two, three))
    assert merged(one, two, one, merged(one, two)) == merged(one, two)


@given(histories, histories)
def test_merged_counts_equal_those_of_one_robot_with_both_histories(a: object, b: object) -> None:
    both = lived("both", [*a, *b])  # type: ignore[misc]
    assert merged(lived("one", a), lived("two", b)).totals() == both.totals()  # type: ignore[arg-type]


@given(histories, histories)
def test_an_older_copy_of_the_same_replica_adds_nothing(a: object, b: object) -> None:
    early = lived("one", a)  # type: ignore[arg-type]
    late = deepcopy(early)
    for episode in b:  # type: ignore[attr-defined]
        late.learn(episode)
    assert merged(early, late) == merged(late)
