"""The paper's Experiments 1, 2 and 3 (Sec. 6.3) as a command: `pushlane experiment all`."""
