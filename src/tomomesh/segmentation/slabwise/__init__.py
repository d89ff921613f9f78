"""What is found out about a study slab by slab, so that it need not be whole in memory."""
