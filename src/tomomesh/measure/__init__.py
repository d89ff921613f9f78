"""TriMesh -> Report: topology, distances, triangle shapes; contours, and how they match."""
