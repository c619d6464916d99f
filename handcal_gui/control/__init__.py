"""Connects the window to the engine."""
