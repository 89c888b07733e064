"""Background work: the queue, and one process for each job."""
