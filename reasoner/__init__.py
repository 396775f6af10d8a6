"""The knowledge graph and its translation to planning problems; inference, task recognition and memory."""
