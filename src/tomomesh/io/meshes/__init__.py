"""Triangle meshes: one file a format, and the tables of what reads and writes each suffix."""
