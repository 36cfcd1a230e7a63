"""The pushing strategy (Sec. 4): chooses the intermediate pushing target inside the corridor."""
