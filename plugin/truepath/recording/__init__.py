"""Driving a robot through a list of poses and writing down where a tracker saw its reflector."""
