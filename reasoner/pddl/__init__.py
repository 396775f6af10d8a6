"""PDDL both ways, and planning problems written as Turtle."""
