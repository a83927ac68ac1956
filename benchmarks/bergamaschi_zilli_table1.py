"""Table 1 of Bergamaschi and Zilli: inexact interior point for the obstacle problem, BiCGStab with Jacobi."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("bergamaschi", 1)
