"""Namespaces of the ontologies, and IRIs that several modules use."""

from __future__ import annotations

CORE = "https://w3id.org/confab/core#"
EMBODIMENT = "https://w3id.org/confab/embodiment#"
EPISODES = "https://w3id.org/confab/episodes#"
MEMORY = "https://w3id.org/confab/memory#"
OWL = "http://www.w3.org/2002/07/owl#"
PROV = "http://www.w3.org/ns/prov#"
RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
RDFS = "http://www.w3.org/2000/01/rdf-schema#"
SHACL = "http://www.w3.org/ns/shacl#"
SKOS = "http://www.w3.org/2004/02/skos/core#"
XSD = "http://www.w3.org/2001/XMLSchema#"
PREFIXES = {"": CORE, "owl": OWL, "rdf": RDF, "rdfs": RDFS, "skos": SKOS, "xsd": XSD}
"""The prefixes that are predefined in every query."""

TYPE = RDF + "type"
INDIVIDUAL = OWL + "NamedIndividual"
LABEL = RDFS + "label"
ARGUMENTS = ("about", *(f"argument{place}" for place in range(2, 10)))
"""Properties that state the arguments of conditions, effects and facts, in order."""
