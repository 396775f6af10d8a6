"""The knowledge graph: files and stores behind one door, inference, the owlready2 view."""
