"""Films: where their frames are, reading, writing, and their sound."""
