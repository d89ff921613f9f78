"""What is said of a result, in words."""

from .batch import of_batch, of_row
from .mesh import of_check, of_part
from .run import of_network, of_points, of_surface

__all__ = ["of_batch", "of_check", "of_network", "of_part", "of_points", "of_row", "of_surface"]
