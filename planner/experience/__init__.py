"""Experience in planning: learned rules with counts, their evaluation, and their use before search."""
