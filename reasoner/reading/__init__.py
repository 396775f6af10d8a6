"""Reading of problems, quantified behaviours and affordances from the graph, limited to the task's part of a scene."""
