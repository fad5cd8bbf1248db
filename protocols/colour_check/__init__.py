"""The check of colours by a chart."""
