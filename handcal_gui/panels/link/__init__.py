"""The link panel: the connection to the headset."""
