"""What the results panel is made of."""
