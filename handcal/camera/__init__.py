"""Sources of frames: one interface for devices, recordings and the simulator."""
