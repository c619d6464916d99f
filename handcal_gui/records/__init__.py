"""Tables of alignments and trials, for the session and trials panels."""
