"""Judge singular positions: detect, cross or refuse them (docs/internals/singular-positions.md).

``thresholds`` lists all thresholds.  ``detection`` decides whether a step contains a singular position,
``determinants`` and ``location`` evaluate the test function and find its zeros, ``acceptance`` judges the
step, ``uniqueness`` bounds the sensitivity of the continuation, ``rounding_pole`` removes the pole due to
rounding, ``start`` judges a motion that begins near a singular position, and ``short_crossing`` takes a run
across one.
"""
