"""Table 2 of Mezzadri and Galligani (2018): DIN with a direct solver, problems 1 to 3, two films."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 2)
