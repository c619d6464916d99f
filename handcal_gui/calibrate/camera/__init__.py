"""The camera panel: colour, depth and the segmented hand."""
