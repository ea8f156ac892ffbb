"""Detection of contact, load and release from joint torques, finger motors, touch and sight."""

from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)  # a new process may find this folder before that of the compiled module
