"""The rigid core."""
