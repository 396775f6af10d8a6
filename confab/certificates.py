"""A certificate in a file, verified against a scene by the checker that shares no code with any search."""

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
    """The verdict of the checker on a certificate. `refused` is the reason that it isn't a proof.

    None if it proves that there is no plan.
    """

    refused: str | None
    claims: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether the certificate proves that there is no plan."""
        return self.refused is None

    def json(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {"holds": self.holds, "refused": self.refused, "proof": list(self.claims)}

    def __str__(self) -> str:
        """Return it as text."""
        if self.refused is not None:
            return f"not accepted: {self.refused}"
        return "\n  ".join(["the certificate holds: there is no plan", *self.claims])


def checked_certificate(scene: Scene, goals: tuple[str, ...], file: Path) -> Checked:
    """Verify the certificate in a file against a scene.

    Parameters
    ----------
    scene : Scene
    goals : tuple of str
        Each replaces the scene's goal of that symbol, as in planning.
    file : Path
        The output of `confab plan --json` for an unsolvable task, or the certificate alone.

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
