"""Derivatives of a solution's numbers, by the scene's and by the film at every point."""
