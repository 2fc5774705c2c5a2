"""Mechanisms of the conformance suite and of tests, one kind in each module.

- ``features`` has a small scene for each feature of the scene format.
- ``moving`` has bodies and loops in motion, ``planar`` loops in one plane.
- ``closed_forms`` has scenes whose exact motions are formulas.
- ``random_mechanisms`` makes closed loops from seeds, ``geared`` adds armatures and a coupling.
- ``large_graphs`` makes mechanisms of 10 to 200 bodies from seeds.
- ``coupled`` has two moving bodies with couplings, armatures, stops, latches and intervals.
- ``random_scenes`` adds all loads and drivers, and makes floating mechanisms and rotors.
- ``hard`` has mechanisms that are stiff, nearly singular or badly scaled.
- ``awkward`` and ``awkward_loops`` make random mechanisms with one numerical difficulty each.
- ``parts`` makes bars and linkages, ``specimens`` lists the scenes of the suite.
"""
