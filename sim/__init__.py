"""Plan in, physical verdict out: the PyBullet world, robot, skills, perception and verification."""
