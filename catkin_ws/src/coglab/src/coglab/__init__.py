"""The Python interface of CogLab: one Robot, running or in virtual time; own controllers; learning environments."""
