"""Acting in a world: executing a plan, observing, repairing, replanning, and scheduling both hands."""
