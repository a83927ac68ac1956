"""Table 6 of Mezzadri and Galligani (2018): DIN against Fischer-Burmeister Newton."""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 6)
