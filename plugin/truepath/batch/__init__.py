"""Many programs with many calibrations, corrected at once: on all cores, or on a Dask cluster."""
