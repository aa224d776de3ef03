"""truepath: learn where the robot really goes, name the cause, correct its programs, prove the gain."""

__version__ = "0.5.0"
