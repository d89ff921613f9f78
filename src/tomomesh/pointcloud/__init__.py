"""What is known of points from their positions alone: neighbors, spacing, noise, holes."""
