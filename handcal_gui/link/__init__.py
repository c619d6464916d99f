"""Parts of the link panel."""
