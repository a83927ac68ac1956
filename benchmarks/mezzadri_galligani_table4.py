"""Table 4 of Mezzadri and Galligani (2018): the conditions on the step length taken apart.

Condition B alone finds wrong solutions: our certificate has to say so.
"""

from published_table import reproduce

if __name__ == "__main__":
    reproduce("mezzadri", 4)
