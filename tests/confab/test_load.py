"""A server under load: normal requests together with slow, abandoned and malformed requests."""

from statistics import median

from benchmarks.load import measured


def test_normal_requests_are_answered_together_with_slow_abandoned_and_malformed_ones() -> None:
    quiet, loaded, said = measured(1 / 60)
    assert loaded.answers["honest", "200"] == len(loaded.seconds) == len(quiet.seconds) == 16
    assert {kind for kind, _ in loaded.answers} == {"honest", "slow", "abandoned", "malformed"}
    assert said == ""
    assert median(loaded.seconds) < 20 * median(quiet.seconds)
