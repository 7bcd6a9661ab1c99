"""The commands of `obscurance`, and what they print."""
