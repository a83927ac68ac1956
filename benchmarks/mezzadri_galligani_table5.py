"""Table 5 of Mezzadri and Galligani (2018): starting vectors, and the perturbations mu1 and mu2."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 5)
