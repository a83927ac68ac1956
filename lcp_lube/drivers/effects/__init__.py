"""Effects: which count, and the loop in which films and effects find one another."""
