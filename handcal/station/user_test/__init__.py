"""The user test of a calibrated wearer: targets, trials, blinded comparisons, and the cube."""
