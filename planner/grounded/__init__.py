"""Grounding of one level to a task whose operators change bits, with heuristic and exhaustive searches of the task."""
