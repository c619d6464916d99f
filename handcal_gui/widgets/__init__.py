"""Widgets shared by panels, pages, dialogs and windows."""
