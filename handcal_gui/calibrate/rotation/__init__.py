"""The rotation panel: how far the hand is rotated from the cursor."""
