"""The embodiment: what the ontology states about robots, furniture and objects, as values for `sim/`."""
