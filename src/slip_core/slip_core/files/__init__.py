"""What is read from files: YAML, URDF, data of packages."""
