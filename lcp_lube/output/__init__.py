"""Results as JSON, files and pictures."""
