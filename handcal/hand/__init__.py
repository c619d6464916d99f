"""Find and segment the hand in a depth frame."""
