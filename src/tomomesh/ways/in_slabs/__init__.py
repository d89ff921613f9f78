"""Ways whose study and mesh are never whole, slab by slab."""
