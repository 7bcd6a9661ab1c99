"""Where rays start so that they neither hit their own surface nor leak through it."""
