"""Worker threads: the engine, and jobs that take longer than a frame."""
