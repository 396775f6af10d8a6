"""Experience in planning: learned rules with counts, their scores, and their use before search."""
