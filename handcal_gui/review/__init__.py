"""A stored session: read, solved again, compared, shown."""
