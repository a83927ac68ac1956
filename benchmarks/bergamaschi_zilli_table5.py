"""Table 5 of Bergamaschi and Zilli: interior point with AINV and with Jacobi. `mpiexec -n P` runs the rows for P ranks."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("bergamaschi", 5)
