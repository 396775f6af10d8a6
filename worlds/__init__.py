"""Worlds for tests and benchmarks: problems as values, exhaustive searches of them, and independent programs for comparison."""
