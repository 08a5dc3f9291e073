"""Rows of the tables of oscillators: the exact recursion from one step to the next (Nigam and Jennings 1969).

u1 = A11 u0 + A12 v0 - B10 g0 - B11 g1 and v1 = A21 u0 + A22 v0 - B20 g0 - B21 g1 for a ground acceleration that goes in
a straight line from g0 to g1; `tdint.analysis.spectra.oscillators` fills them.
"""

A11 = 0
A12 = 1
B10 = 2
B11 = 3
A21 = 4
A22 = 5
B20 = 6
B21 = 7
RECURSION_ROWS = 8
