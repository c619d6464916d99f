"""The main window: calibrating one wearer, and the review of a stored session."""
