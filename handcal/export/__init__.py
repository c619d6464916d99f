"""Files for others from a session: report, tables, matrices, clouds and the session itself."""
