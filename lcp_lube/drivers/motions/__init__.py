"""How films answer to small motions of their walls: stiffness and damping."""
