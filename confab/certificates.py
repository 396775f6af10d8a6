"""Verification of a certificate file against a scene; the checker shares no code with the search."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from confab.interchange import read_certificate
from confab.labels import labels_of
from confab.planner.certificate_checks import refusal
from confab.reasoner.reading.goals import with_goals
from confab.why import proved

if TYPE_CHECKING:
    from confab.scene import Scene


@dataclass(frozen=True)
class Checked:
    """The verdict of the checker on a certificate of unsolvability.

    `refused` is the reason why the certificate proves nothing; it is None if the certificate proves that there is no plan.
    `claims` are the claims of the proof as sentences.
    """

    refused: str | None
    claims: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether the certificate proves that there is no plan."""
        return self.refused is None

    def json(self) -> dict[str, Any]:
        """Return the verdict as JSON data."""
        return {"holds": self.holds, "refused": self.refused, "proof": list(self.claims)}

    def __str__(self) -> str:
        """Return the verdict as text."""
        if self.refused is not None:
            return f"not accepted: {self.refused}"
        return "\n  ".join(["the certificate holds: there is no plan", *self.claims])


def checked_certificate(scene: Scene, goals: tuple[str, ...], file: Path) -> Checked:
    """Verify the certificate in a file against a scene.

    Parameters
    ----------
    scene : Scene
    goals : tuple of str
        Each goal replaces the scene's goal for the same symbol, as in planning.
    file : Path
        A file with the output of `confab plan --json` for an unsolvable task, or with the certificate alone.

    Raises
    ------
    KnowledgeError
        The file contains no certificate, or a goal mentions terms that the scene doesn't have.
    """
    certificate = read_certificate(file)
    scene.settle()
    problem = with_goals(scene.problem, goals)
    refused = refusal(problem, certificate)
    return Checked(refused, () if refused else proved(certificate, labels_of(scene.knowledge, scene.names, problem)))
