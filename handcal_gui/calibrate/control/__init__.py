"""Controllers: connect the window to the engine."""
