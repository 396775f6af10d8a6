"""Behaviours written as SPARQL updates: read into the individuals that say the same, and written back."""
