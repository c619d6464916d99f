"""The desktop program: a window over the engine `handcal`."""
