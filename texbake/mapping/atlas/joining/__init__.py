"""Joining charts with their neighbors, and cutting them to meet a bound on stretch."""
