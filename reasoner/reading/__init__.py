"""From the graph to values: problems, quantified behaviours, affordances, the part of a world that a task can need."""
