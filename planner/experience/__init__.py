"""Experience at the planner's side: what is counted, how it judges, and the search that it leads."""
