"""A run while it happens, seen from outside the dark room."""
