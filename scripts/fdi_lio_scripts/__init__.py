"""Code that the Python scripts of fdi_lio share: trajectories, metrics, recordings, pictures."""
