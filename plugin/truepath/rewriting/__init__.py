"""From a program and a calibration to a corrected program: resolve, correct, keep to the path, guard, rewrite."""
