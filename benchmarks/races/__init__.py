"""Races of `speed.py`: each file prints the rows of one kind of work."""
