"""From a TOML or glTF file to a scene."""
