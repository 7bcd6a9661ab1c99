"""Work in blocks: threads, journals to resume from, parts and their merge."""
