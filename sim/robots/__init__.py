"""External robots: an interface is data, and one adapter turns every interface into a world (docs/connecting.md)."""
