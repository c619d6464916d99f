"""Export of a session: report, tables, matrices, clouds and the session itself."""
