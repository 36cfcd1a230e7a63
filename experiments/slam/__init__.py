"""Mapping and localisation on laser logs, made by others or recorded here."""
