"""The wizard: the next instruction in one sentence, and the button that carries it out."""
