"""The web server: who may speak to it, what goes to each browser, which files are served."""
