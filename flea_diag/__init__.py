"""flea_diag: hybrid fault diagnosis of electro-mechanical actuators on a test stand."""

__version__ = "0.1.0"
