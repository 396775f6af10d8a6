"""Acting in a world: carrying a plan out, noticing, repairing, replanning, and scheduling both hands."""
