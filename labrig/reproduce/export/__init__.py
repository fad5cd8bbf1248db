"""Scenes written for other renderers."""
