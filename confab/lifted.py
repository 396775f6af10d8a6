"""Lifted facts, by which memory tells what was chosen from what wasn't (`planner.experience.features`), as sentences in labels."""

from __future__ import annotations

import re
from collections.abc import Mapping

from confab.labels import Labels

STEPS = {
    "goal": "the {situation} wanted for {of}",
    "who": "what has {of} as its {situation}",
    "wants": "what shall have {of} as its {situation}",
    "": "the {situation} of {of}",
}
TRUTH = {"yes": "", "no": "not: ", "true": "", "false": "not: "}


def sentence(fact: str, value: str, labels: Labels, roles: Mapping[str, str]) -> str:
    """Return a lifted fact and its value as a sentence.

    Parameters
    ----------
    fact, value : str
        As memory counts them: ``target · goal LOCATION = targetPlace``, ``yes``.
    labels : Labels
    roles : mapping of role to individual
        Of the candidate that the fact is about.
    """

    def path(text: str) -> str:
        role, *steps = text.split(" · ")
        said = f"{labels.name(roles[role])} (the {role})" if role in roles else f"the {role}"
        for step in steps:
            way, _, situation = step.rpartition(" ")
            said = STEPS[way].format(situation=labels.name(situation), of=said)
        return said

    if value == "–":
        return "no such question arises"
    if match := re.fullmatch(r"(.+) wanted (\S+)", fact):
        of = f"the {labels.name(match[2])} of {path(match[1])}"
        status = {
            "none": f"nothing is wanted of {of}",
            "met": f"{of} is as wanted",
            "unmet": f"{of} isn't yet as wanted",
        }
        return status.get(value, f"{of} is {value}")
    if match := re.fullmatch(r"how many (\S+) (.+)", fact):
        return f"{value} {labels.name(match[1])} {path(match[2])}"
    if match := re.fullmatch(r"(.+) (\S+) how many", fact):
        return f"{path(match[1])} {labels.name(match[2])} {value}"
    if match := re.fullmatch(r"something (\S+) (\S+) and (.+)", fact):
        if value == "none":
            return f"nothing is {path(match[3])}"
        none = "nothing" if value == "no" else "something"
        return f"{none} {labels.name(match[1])} both {path(match[2])} and {path(match[3])}"
    if match := re.fullmatch(r"others of (\S+) · (\S+) is", fact):
        return f"the {labels.name(match[2])} of the others like {path(match[1])} is {labels.name(value)}"
    if match := re.fullmatch(r"(.+) is(?: who)?", fact):
        return f"{path(match[1])} is {labels.name(value)}"
    if match := re.fullmatch(r"(.+) = (\S+)", fact):
        if value == "none":
            return f"nothing is {path(match[1])}"
        return f"{path(match[1])} is {'not ' if value == 'no' else ''}{path(match[2])}"
    return _tied(fact, value, labels, path)


def _tied(fact: str, value: str, labels: Labels, path: object) -> str:
    """Return a fact that ties two ends to each other by a relation, or a situation type to two roles."""
    assert callable(path)
    words = re.fullmatch(
        r"(\S+(?: · (?:(?:goal|who|wants) )?\S+)*) (\S+) (\S+(?: · (?:(?:goal|who|wants) )?\S+)*)", fact
    )
    if words is None or fact.startswith("goal "):
        return f"{fact}: {value}"
    if words[1] in labels.domain.situations:
        return TRUTH.get(value, "") + f"{path(words[2])} {labels.verbs.get(words[1], words[1])} {path(words[3])}"
    if value == "none":
        return f"nothing is {path(words[3] if ' · ' in words[3] else words[1])}"
    return TRUTH.get(value, f"{value}: ") + f"{path(words[1])} {labels.name(words[2])} {path(words[3])}"
