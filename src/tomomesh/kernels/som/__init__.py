"""Matching, updating and batch steps of networks, and the polygons that they lie on."""
