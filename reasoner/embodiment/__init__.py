"""What the ontology says about bodies, as values for `sim/`."""
