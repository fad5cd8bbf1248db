"""Pictures: rendered, shown on a display or to the eye of the night, and written as files."""
