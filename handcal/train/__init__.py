"""Training and export of the hand detector; the only room that needs PyTorch."""
