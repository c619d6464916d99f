"""The hand cloud panel: a 3D view without OpenGL."""
