"""The window of the session library."""
