"""Table 10 of Mezzadri and Galligani (2018): DIN with GMRES or BiCGStab and ILU(0), problem 1, n = 1000 and 10,000."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 10)
