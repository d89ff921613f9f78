"""The shell of cubes of a cloud."""
