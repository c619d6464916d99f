"""The desktop program: a window over the engine `handcal`."""

FIRST_SIZE_PX = 1600, 1000
"""Size of the main window when it first opens, if the screen is large enough."""
