"""Random worlds as values, for tests and benchmarks alike."""
