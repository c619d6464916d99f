"""The acceptance of a finished rig by a camera in the place of the eye."""
