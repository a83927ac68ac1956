"""Table 11 of Mezzadri and Galligani (2018): DIN on the square.

Problem 4, 50 x 50 and 100 x 100. With --quick, 50 x 50 alone.
"""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 11)
