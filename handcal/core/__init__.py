"""The vocabulary that every package uses: values, errors, geometry and the display model."""
