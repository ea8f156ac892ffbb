"""Recordings of people: importers for public datasets."""
