"""Triangles: distances, edges, shapes, intersections; and polygons."""
