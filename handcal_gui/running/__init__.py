"""The engine at work for the window: the only threads of the desktop."""
