"""Studies on simulated wearers: thousands of trials, in many processes, and what they add up to."""
