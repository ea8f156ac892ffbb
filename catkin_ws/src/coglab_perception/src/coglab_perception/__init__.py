"""The interface of perception to the rest of the system, and recognition of the partner's reaching motion."""

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)  # a new process may find this folder before that of the compiled module
