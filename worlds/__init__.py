"""Worlds for tests and benchmarks: random problems, exhaustive searches of the problems, and independent programs."""
