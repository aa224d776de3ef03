"""Programs: parse, rewrite, write. Nothing here knows of calibration."""
