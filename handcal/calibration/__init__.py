"""The procedure of one wearer's calibration: its plan, its steps, and its result."""
