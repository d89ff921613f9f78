"""A result as one HTML file that opens anywhere: plain data in, text out; no server, no network."""
