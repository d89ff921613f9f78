"""The dynamic mesh: masses on springs, drawn to points or to the surface under them, and taken back where it folds."""
