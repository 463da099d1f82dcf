"""What does the tasks of a sweep: threads of this process, processes of this machine, or a Dask cluster."""
