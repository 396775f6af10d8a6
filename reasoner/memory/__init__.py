"""The planner's memory: knowledge links, learned experience and episodes, as dataclasses and as files."""
