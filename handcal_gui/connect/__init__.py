"""Connecting headsets and other programs: pairing, the link, OpenXR."""
