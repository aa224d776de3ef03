"""A Universal Robots controller on a loopback address, for tests: its protocols in front, a real robot behind it."""
