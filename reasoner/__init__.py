"""Knowledge graph in, grounded symbols out; inference, task recognition, and the memory's home."""
