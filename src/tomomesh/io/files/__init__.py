"""Files as such: what a path leads to, how much a file may promise, and outputs that are whole or not there."""
