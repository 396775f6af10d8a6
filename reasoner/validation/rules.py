"""Table of the validation rules in Python, which check properties that SPARQL can't express well.

A rule is a function that yields the faults of a `Case`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from confab.reasoner.validation import behaviors, contradictions, definitions, quantities, terms, times
from confab.reasoner.validation.case import Case, Fault, ReadCase
from confab.reasoner.validation.exclusive import values_not_kept_exclusive

RULES: dict[str, Callable[[Case], Iterator[Fault]]] = {
    "undeclared-term": terms.undeclared_terms,
    "relative-iri": terms.relative_iris,
    "missing-all-different": terms.individuals_not_different,
    "file-name-and-iri": terms.files_and_iris,
}
"""Rules that any graph is checked with."""
RULES_ON_PROBLEMS: dict[str, Callable[[ReadCase], Iterator[Fault]]] = {
    "undetermined-variable": behaviors.undetermined_variables,
    "other-kind": behaviors.other_kinds_in_when,
    "every-member-required": behaviors.every_member_required,
    "unreachable": behaviors.unreachable_behaviors,
    "value-gap": behaviors.gaps_of_values,
    "crowded": behaviors.crowded_places,
    "impossible-situation": contradictions.impossible_situations,
    "not-exclusive": values_not_kept_exclusive,
    "definition-without-effect": definitions.definitions_without_effect,
    "axiom-not-watched": definitions.axioms_not_watched,
    "contradiction": contradictions.contradictions,
    "repeated-name": contradictions.repeated_names,
    "amount-out-of-reach": quantities.amounts_out_of_reach,
    "unit-mismatch": quantities.unlike_units,
    "duration-unit": times.durations_in_other_units,
    "window-too-short": times.windows_too_short,
    "actor-left-out": times.actors_left_out,
    "earlier-state-of-others": definitions.earlier_states_of_others,
    "product-of-amounts": quantities.multiplied_amounts,
    "conclusion-outside-class": definitions.conclusions_outside_class,
    "number-missing": quantities.numbers_missing,
    "number-missing-for-member": quantities.numbers_missing_for_members,
    "defined": definitions.defined,
}
"""Rules that a graph is checked with if its planning problem can be read."""
WARNINGS = frozenset(
    {
        "axiom-not-watched",
        "crowded",
        "every-member-required",
        "file-name-and-iri",
        "number-missing",
        "number-missing-for-member",
        "other-kind",
        "product-of-amounts",
        "repeated-name",
        "window-too-short",
    }
)
"""Rules whose findings don't prevent planning."""
REMARKS = frozenset({"actor-left-out", "defined"})
"""Rules whose findings are choices of the author or information about the ontology, and not faults."""
