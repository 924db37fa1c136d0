"""Load capacity of gears by ISO 6336, with every intermediate value and its formula.

The modules keep the symbols and the units of the standard: mm, N, N/mm^2 (MPa), um, mm^2/s, 1/min. Numbers of formulas
and clauses are those of the editions of 2006 (part 5: 2016); where the editions of 2019 differ, the modules say so and
`data.RatingData.edition` chooses. Signs are those of ISO 21771: tooth numbers, diameters and the centre distance of
internal gears are negative.
"""
