"""What is solved: films, grids, equations, exact solutions. Knows no solver."""
