"""The objects that are handed over: files, schema and loader."""
