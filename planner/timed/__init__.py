"""Timed plans: the necessary order of a plan's steps, schedules of the steps, and a checker (docs/levels.md, "In time")."""
