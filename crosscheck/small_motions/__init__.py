"""Small motions about equilibria and steady motions: closed forms, the judge, mbref and engines compared."""
