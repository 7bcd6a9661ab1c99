"""What a user looks at: pages, reports, the clay look."""
