"""What `tomomesh inspect` finds, tells, and suggests."""
