"""The knowledge graph: loading of files, connections to stores, inference, and the view as an owlready2 world."""
