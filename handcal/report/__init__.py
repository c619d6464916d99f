"""A report, described once and written as PDF, as HTML, and as its figures with their raw rows."""
