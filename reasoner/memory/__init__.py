"""The memory's home: knowledge links, counts and episodes, as values and as files."""
