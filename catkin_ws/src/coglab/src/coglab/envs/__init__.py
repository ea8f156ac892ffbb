"""Gymnasium environments over the virtual world."""
