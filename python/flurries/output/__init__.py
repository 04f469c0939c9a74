"""Frames to files: sequences that several processes make, films, clusters."""
