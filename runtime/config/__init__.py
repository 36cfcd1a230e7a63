"""Configuration: TOML in layers into typed, documented structures, every value with its origin."""
