"""Work for many processes and machines, on Dask: no scheduler, queue or wire of our own."""
