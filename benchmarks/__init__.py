"""Benchmarks whose results the documentation quotes, run by `python -m benchmarks`."""
