"""Treatment of singular positions: detect, cross or refuse them (docs/internals/singular-positions.md).

``thresholds`` lists all thresholds. ``detection`` decides whether a step contains a singular position.
``determinants`` evaluates the test function, and ``location`` finds its zeros. ``acceptance`` judges a step
near a singular position. ``uniqueness`` bounds the sensitivity of the continuation. ``rounding_pole`` removes
the pole that rounding causes. ``start`` judges a motion that starts near a singular position.
``steps_across`` takes a run across a singular position, and ``branches`` along requested branches.
"""
