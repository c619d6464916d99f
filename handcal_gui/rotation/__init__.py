"""Parts of the rotation panel."""
