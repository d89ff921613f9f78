"""One network on every slice: window -> networks, and the surface that rings lie on."""
