"""Worlds for tests and benchmarks: problems as values, exhaustive searches of the problems, and independent programs."""
