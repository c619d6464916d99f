"""Studies on simulated wearers: thousands of trials, in many processes, and their reports."""
