"""A scene's way to an answer."""
