"""Parts of the camera panel."""
