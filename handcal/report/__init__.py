"""Reports: described once, written as PDF, HTML, and figures with their data."""
