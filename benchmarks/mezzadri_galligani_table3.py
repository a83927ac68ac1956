"""Table 3 of Mezzadri and Galligani (2018): DIN with GMRES without preconditioner or restart.

Problem 1, n = 50 to 1000. Minutes; with --quick, n = 50 and 100, seconds.
"""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 3)
