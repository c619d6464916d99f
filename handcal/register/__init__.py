"""Register the hand at alignment against the cursor, and solve the eye shift."""
