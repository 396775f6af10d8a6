"""Shipped mechanisms with a part moved, a limit widened or an axis turned are refused; `benchmarks.solids` has more of them."""

from benchmarks.solids import HARMLESS, WRONG, mutants


def test_mechanisms_that_have_been_made_wrong_are_refused_and_harmless_changes_are_not() -> None:
    wrong = harmless = 0
    for mutant in mutants(seed=7):
        if mutant.depth >= WRONG:
            assert mutant.refused, f"{mutant.scene}: {mutant.change}, {mutant.depth * 1000:.1f} mm"
            wrong += 1
        elif mutant.depth <= HARMLESS:
            assert not mutant.refused, f"{mutant.scene}: {mutant.change}"
            harmless += 1
        if wrong >= 10 and harmless >= 5:
            break
