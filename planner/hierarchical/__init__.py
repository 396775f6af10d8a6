"""The default planner: achieves goals one after another on a mutable state table and refines each step at once."""
