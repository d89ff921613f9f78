"""Triangles: distances, edges, shapes, intersections."""
