"""One level grounded to bits: reachability, operators, heuristic search, all of its states."""
