"""Parts of the hand cloud panel: points in space, drawn without OpenGL."""
