"""The planner takes a problem as symbols, searches for plans, executes plans in a world, and learns from executions.

This package uses no RDF and no physics.
"""
