"""Sending a corrected program to a robot, watching it run, and telling where the robot went."""
