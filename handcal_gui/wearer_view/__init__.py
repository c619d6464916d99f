"""Parts of the wearer's view panel."""
