"""Conservative horizons: rays that cannot hit anything are counted without tracing."""
