"""Widgets that any panel or page may be made of."""
