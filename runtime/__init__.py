"""The runtime: messages, the service contract, schedulers, journal, recorder, configuration, command line."""
