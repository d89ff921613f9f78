"""PointSet -> TriMesh: partition, closing, cuberille, low-pass filter, dynamic mesh."""
