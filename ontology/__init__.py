"""What exists: core vocabulary, domains, robots, scenes, shapes, checks and questions, as files."""
