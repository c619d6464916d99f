"""The fine-tuning panel: φ set by hand."""
