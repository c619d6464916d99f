"""The main window's pages: start, wizard, review."""
