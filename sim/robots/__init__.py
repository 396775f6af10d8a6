"""External robots: their interfaces are data, and one adapter makes each interface a world (docs/connecting.md)."""
