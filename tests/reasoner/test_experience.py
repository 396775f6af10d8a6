"""Counts that only grow: merging them is adding, in any order and any number of times."""

from copy import deepcopy

from hypothesis import given
from hypothesis import strategies as st

from reasoner.memory.counts import Candidate, Conclusion, Decision, Experience, Tally

candidates = st.builds(
    lambda behavior, kind, value, who: Candidate(
        Conclusion(behavior, (kind,)), (("object is", value),), (("object", who),)
    ),
    st.sampled_from(["MOVE", "POUR"]),
    st.sampled_from(["Cup", "Bottle"]),
    st.sampled_from(["met", "unmet", "none"]),
    st.sampled_from(["cup1", "cup2"]),
)
decisions = st.builds(Decision, candidates, st.lists(candidates, max_size=3).map(tuple), st.booleans())
histories = st.lists(st.lists(decisions, max_size=3), max_size=3)


def lived(replica: str, history: list[list[Decision]]) -> Experience:
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
def test_the_raw_counts_equal_those_of_one_robot_that_lived_both_histories(a: object, b: object) -> None:
    both = lived("both", [*a, *b])  # type: ignore[misc]
    assert merged(lived("one", a), lived("two", b)).totals() == both.totals()  # type: ignore[arg-type]


@given(histories, histories)
def test_an_older_copy_of_the_same_replica_adds_nothing(a: object, b: object) -> None:
    early = lived("one", a)  # type: ignore[arg-type]
    late = deepcopy(early)
    for episode in b:  # type: ignore[attr-defined]
        late.learn(episode)
    assert merged(early, late) == merged(late)


def test_success_and_failure_are_counted_apart() -> None:
    move = Candidate(Conclusion("MOVE", ("Cup",)), (("object is", "met"),))
    pour = Candidate(Conclusion("POUR", ("Cup",)), (("object is", "met"),))
    experience = Experience("one")
    experience.learn([Decision(move, (pour,)), Decision(move, succeeded=False)])
    totals = experience.totals()
    assert totals[move.conclusion][move.pattern] == Tally(chosen=1, failed=1)
    assert totals[pour.conclusion][pour.pattern] == Tally(passed_over=1)
