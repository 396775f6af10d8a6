"""The paper's mode: A* with cogency on each level, each behaviour refined on the level below."""
