"""Campaigns that take minutes, run by hand, and the page that is made of what they print."""
