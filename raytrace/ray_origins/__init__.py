"""Ray origins from which rays neither hit their own surface nor leak through it."""
