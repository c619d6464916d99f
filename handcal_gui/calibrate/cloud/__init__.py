"""The hand cloud panel: a 3D view drawn without OpenGL."""
