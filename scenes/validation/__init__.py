"""Closed forms and an independent reference to judge a bake by."""
