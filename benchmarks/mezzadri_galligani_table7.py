"""Table 7 of Mezzadri and Galligani (2018): pressures in the cavity, DIN and FBN.

Positive by DIN, of both signs at rounding level by Fischer-Burmeister Newton.
"""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 7)
