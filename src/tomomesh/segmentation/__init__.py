"""Volume -> PointSet: window, networks, regions, points."""
