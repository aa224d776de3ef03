"""Which poses to measure, in which order and on which way: as certain as possible, free of collision, in sight."""
