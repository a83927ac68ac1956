"""Table 8 of Mezzadri and Galligani (2018): DIN with LAPACK's dense LU, problem 1, n = 100 to 1000."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 8)
