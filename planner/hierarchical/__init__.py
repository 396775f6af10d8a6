"""The default planner: it achieves goals one after another on a table of current values, and refines each step at once."""
