"""Reading of problems, quantified behaviours and affordances from the graph, for the part of a scene that a task needs."""
