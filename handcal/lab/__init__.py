"""Evaluation on given data and on simulated wearers: studies, other methods, benchmarks."""
