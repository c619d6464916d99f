"""The program operating itself, for demonstrations and screenshots."""
