"""Table 4 of Bergamaschi and Zilli: inexact Newton with AINV and Jacobi. `mpiexec -n P` runs the rows printed for P ranks."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("bergamaschi", 4)
