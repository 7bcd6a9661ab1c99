"""One model of mesh files: every format is read into it, and every command takes it."""
