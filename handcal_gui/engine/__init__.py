"""Threads: the engine that calibrates, and jobs that take longer than a frame."""
