"""Plans in time: the order that the steps of a plan need, schedules of it, and their checker (docs/levels.md, "In time")."""
