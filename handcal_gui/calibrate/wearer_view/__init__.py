"""The wearer's view panel."""
