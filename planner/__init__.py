"""Symbols in, plan out: search, cogency, refinement, acting and learning. Knows no RDF and no physics."""
