"""Table 9 of Mezzadri and Galligani (2018): DIN with SuperLU and MUMPS, problem 1, n = 100 to 10,000."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 9)
