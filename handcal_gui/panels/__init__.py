"""The panels: each shows one thing and asks for changes by signals; none does any maths."""
