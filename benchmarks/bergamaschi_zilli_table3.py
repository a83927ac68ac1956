"""Table 3 of Bergamaschi and Zilli: Newton with block Cimmino. `mpiexec -n P` runs the rows printed for P ranks."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("bergamaschi", 3)
