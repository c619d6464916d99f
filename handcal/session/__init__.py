"""A stored session: folder, journal, alignments, trials."""
