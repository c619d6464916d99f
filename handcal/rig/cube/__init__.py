"""The ArUco cube of the cube test: its description, detection and net to print."""
