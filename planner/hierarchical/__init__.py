"""The default planner: goals in series on one table that is changed in place, levels below as they are needed."""
