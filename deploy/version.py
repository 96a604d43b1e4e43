"""The version of this project, the one place that states it for programs; pyproject.toml states it for installers."""

VERSION = "0.1.0"
