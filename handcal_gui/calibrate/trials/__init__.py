"""The trials panel: user-test trials and their errors."""
