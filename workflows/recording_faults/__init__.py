"""Parts of ``record_faults.py``."""
