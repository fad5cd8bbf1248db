"""Common parts of protocols: pose, rest, exposure, checks, configuration."""
