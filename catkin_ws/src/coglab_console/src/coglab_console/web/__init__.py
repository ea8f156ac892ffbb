"""The web server: access, messages to the browsers, and served files."""
