"""Small recorded runs with the numbers of their results, to hold every change of labrig against."""
