"""Behaviours as SPARQL updates: compilation into individuals, and the inverse translation."""
