"""What tests and benchmarks both need: worlds as values, the truth about them, and programs to hold ours against."""
