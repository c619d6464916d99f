"""Comparison of handcal's parts with annotated data."""
