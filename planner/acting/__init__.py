"""Acting in a world: the executive carries out a plan, observes, repairs the plan, replans, and schedules several hands."""
