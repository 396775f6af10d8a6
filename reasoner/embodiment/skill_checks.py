"""Validation rules on skills that are described by phases (`RULES`).

`confab.sim.phases` also calls `unplayed`, `unset` and `endless` before it executes a skill.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from confab.reasoner.embodiment.facts import camel
from confab.reasoner.embodiment.skills import TERM
from confab.reasoner.embodiment.values import Embodiment, Flaw, Phase, SkillUse

JOINT_NUMBERS = {"opened", "shut", "lower", "upper", "wide"}
"""Numbers of a joint that an expression may contain."""

MEASURED_NUMBERS = {"clear"}
"""Numbers that an expression may name and that are computed when the skill runs."""

WITHOUT_ROLE = {"hand", "supports"}
"""Words that a phase may contain in place of a role; the behaviour needs no parameter or variable for these words."""


def roles_of(use: SkillUse) -> set[str]:
    """Return the roles of a behaviour's parameters and variables."""
    return {role for role in (*use.parameters, *use.variables.values()) if role}


def unplayed(use: SkillUse) -> Iterator[tuple[Phase, str]]:
    """Yield each phase that mentions a role which no parameter or variable of the behaviour has, together with the role."""
    for phase in use.phases:
        for word in (phase.by, *phase.to.split(), *phase.touches):
            role = word.partition(".")[0]
            if role not in WITHOUT_ROLE | roles_of(use):
                yield phase, role


def unset(use: SkillUse) -> Iterator[tuple[Phase, str]]:
    """Yield each phase in whose expressions an unknown name occurs, together with the name."""
    for phase in use.phases:
        bounds = [guard.bound for guard in (*phase.until, *phase.checks)]
        for expression in (*phase.offset, phase.above, phase.value, phase.speed, phase.wait, *bounds):
            for _, term in TERM.findall(expression):
                known = term in use.numbers or term in JOINT_NUMBERS | MEASURED_NUMBERS
                if not (term[0].isdigit() or term[0] == "." or known):
                    yield phase, term


def endless(use: SkillUse) -> Iterator[tuple[Phase, str]]:
    """Yield each phase whose motion has no stated end, together with the missing attribute."""
    for phase in use.phases:
        if phase.motion in ("free", "line", "yielding", "joint", "over", "drive") and not phase.to:
            yield phase, "to"
        if phase.motion == "joint" and not phase.value:
            yield phase, "value"
        if phase.motion == "rise" and phase.above == "0":
            yield phase, "above"


def role_not_played(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield phases that mention a role which no parameter or variable of the behaviour has."""
    for use in embodiment.skills.values():
        for phase, role in unplayed(use):
            yield (
                phase.iri,
                f"phase {phase.name} names the role {role}, but no term of {use.behavior} has this role",
                f"the skill {use.skill} needs an individual in that role",
                f"state e:role e:{role} of one of its parameters or variables, and e:asksFor e:{role} of the skill",
            )


def unknown_setting(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield phases with an expression that contains an unknown name."""
    for use in embodiment.skills.values():
        for phase, term in unset(use):
            yield (
                phase.iri,
                f"phase {phase.name} of {use.skill} has '{camel(term)}', which is neither a number nor a setting of the skill",
                "an expression is a sum of numbers and settings",
                f"state e:{camel(term)} of the skill, or correct the spelling; declare a setting of your own first: "
                f":{camel(term)} a owl:DatatypeProperty ; rdfs:subPropertyOf e:setting",
            )


def phase_without_end(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield phases whose motion has no stated end."""
    for use in embodiment.skills.values():
        for phase, missing in endless(use):
            yield (
                phase.iri,
                f"phase {phase.name} of {use.skill} has the motion {phase.motion}, but no end",
                "a motion ends at its goal, or earlier when a guard of e:until holds",
                f"state e:{missing} of the phase",
            )


def unknown_feature(embodiment: Embodiment) -> Iterator[Flaw]:
    """Yield links that may be the goal of a phase but lack the feature that the phase mentions."""
    links = {link.name: link for mechanism in embodiment.mechanisms for link in mechanism.links}
    for use in embodiment.skills.values():
        needed = {tuple(word.split(".")): phase for phase in use.phases for word in phase.to.split() if "." in word}
        for (role, feature), phase in needed.items():
            for name in use.links.get(role, ()):
                if feature not in links[name].features:
                    yield (
                        name,
                        f"{name} has no feature '{feature}', to which phase {phase.name} of {use.skill} brings the hand",
                        f"{use.behavior} is applicable to {name}, and the hand needs that feature",
                        f"give {name} an e:feature whose IRI ends with .{feature}, or correct the spelling",
                    )


RULES: dict[str, Callable[[Embodiment], Iterator[Flaw]]] = {
    "role-not-played": role_not_played,
    "unknown-setting": unknown_setting,
    "phase-without-end": phase_without_end,
    "unknown-feature": unknown_feature,
}
