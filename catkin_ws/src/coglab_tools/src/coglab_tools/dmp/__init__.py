"""Teaching: records and recordings become primitives."""
