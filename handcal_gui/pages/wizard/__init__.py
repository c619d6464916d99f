"""The wizard: what comes next, said in one sentence, and the button that does it."""
