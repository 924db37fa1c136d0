"""Gear trains in an elastic housing: the housing, the train, its vibration over time and its steady states."""
