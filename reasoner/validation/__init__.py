"""Validation of ontologies: faults with their position, cause and remedy."""
