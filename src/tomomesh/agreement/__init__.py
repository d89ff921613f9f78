"""How near a mesh is to what it should be: to the voxels of a segmentation, or to another mesh."""
