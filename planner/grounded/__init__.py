"""One level as a grounded task: reachability, operators on bits, heuristic search, exhaustive search."""
