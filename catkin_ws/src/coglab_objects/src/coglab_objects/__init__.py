"""The objects of the handovers: files, schema and loader."""
