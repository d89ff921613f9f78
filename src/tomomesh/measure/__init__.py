"""TriMesh -> Report: topology, distances, triangle shapes."""
