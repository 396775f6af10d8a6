"""Import and export of PDDL, and planning problems written as Turtle."""
