"""Matching, updating and batch steps of networks."""
