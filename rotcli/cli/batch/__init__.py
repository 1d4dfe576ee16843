"""Many runs in one command: worker processes or a Dask cluster."""
