"""The columns of every table, each declared here once: its name, where its value comes from, and what it means.

A name ends with its unit (`tdint.output_units.ENDS`); a quantity that is absolute says so, all others are
relative to the ground or to the floor below. An estimated error of a column is called `<column>_error`.
"""
