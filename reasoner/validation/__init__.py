"""What is wrong in an ontology: where, why, and what to do."""
