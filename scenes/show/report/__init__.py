"""Reports of bakes and pictures: the same values as JSON and as a page to read."""
