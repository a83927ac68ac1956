"""Films: geometry, discretisation, and what is read off an answer."""
