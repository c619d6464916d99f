"""Parts that several panels and pages of the main window use."""
