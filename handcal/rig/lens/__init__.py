"""Cameras calibrated from views of a board: lens, uncertainty, and poses of two cameras."""
