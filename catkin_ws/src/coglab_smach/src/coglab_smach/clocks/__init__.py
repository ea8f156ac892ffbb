"""Clocks that states measure time and wait by: the steady one, and a virtual one in which threads take turns."""
