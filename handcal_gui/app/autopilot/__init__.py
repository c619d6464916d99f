"""Automatic operation of the program, for demonstrations and screenshots."""
