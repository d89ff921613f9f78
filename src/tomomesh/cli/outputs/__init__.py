"""What a command writes."""
