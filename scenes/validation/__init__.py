"""Closed forms and an independent reference, to compare bakes with."""
