"""Plan in, physical verdict out: the PyBullet world, robot, skills, perception and verification.

=============================================== =====================================================================
`sim.verify.verify(embodiment, initial, …)`     carries out a plan's primitives in a new world: a `Rollout`
`sim.verify.expectations(problem, steps)`       the states that it is held against
`sim.world.World(embodiment, initial, seed=0)`  the world itself, `observe()` and `execute(step)`, for closed loops
`sim.reach.reach(embodiment)`                   which places each hand reaches, by geometry alone
`sim.film.Film(path, steps, titles)`            records a world that it is given to watch
`sim.verdict.CODES`                             how a primitive can fail
=============================================== =====================================================================
"""
