"""From the graph to values: problems, quantified behaviours, affordances, and the part of a world that a task can need."""
