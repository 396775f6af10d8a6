"""The memory: knowledge links, counts and episodes, as values and as files."""
