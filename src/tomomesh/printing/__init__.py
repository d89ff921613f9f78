"""From a finished mesh to a part that can be printed: TriMesh -> TriMesh, and a verdict on it."""
