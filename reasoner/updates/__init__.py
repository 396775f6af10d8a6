"""Behaviours as SPARQL updates: compiled into individuals, and written back."""
