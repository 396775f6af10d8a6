"""The planner: it takes a problem as symbols, searches for plans, executes them in a world, and learns from them.

This package uses no RDF and no physics.
"""
