"""Reading of problems, quantified behaviours and affordances from the graph, and selection of the part of a scene that a task
needs."""
