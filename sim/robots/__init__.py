"""Robots that others control: their interfaces are data, and one adapter makes a world of each (docs/connecting.md)."""
