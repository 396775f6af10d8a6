"""The default planner: achieves goals one after another on a mutable state table and searches lower levels only as needed."""
