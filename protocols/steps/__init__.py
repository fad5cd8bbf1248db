"""What several protocols are made of: posing, resting, exposing, watching, arranging."""
