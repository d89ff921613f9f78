"""PointSet -> cubes -> closed shell -> square faces: partition, closing, leak test, cuberille."""
