"""The simulated cell of CogLab: it replaces robot and people behind the wire protocols."""

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)  # a new process may find this folder before that of the compiled modules
