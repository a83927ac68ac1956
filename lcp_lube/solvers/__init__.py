"""How it is solved: outer loops, directions, step lengths. Knows no film."""
