"""The session panel: alignments, events and notes."""
