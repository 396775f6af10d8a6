"""The ontology's description of robots, furniture and objects, as dataclasses for `sim/`."""
