"""What ways from points begin with, and share."""
