"""The paper's mode, which plans with A* and cogency on each level, and refines each behaviour on the level below."""
