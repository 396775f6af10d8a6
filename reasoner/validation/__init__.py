"""Validation of an ontology: faults with position, cause and remedy."""
