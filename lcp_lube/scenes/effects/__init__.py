"""Effects beyond the rigid, isoviscous film: one file each."""
