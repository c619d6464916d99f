"""Where frames come from: one interface for devices, recordings and the simulator."""
