"""Datagrams between the PC and the headset."""
