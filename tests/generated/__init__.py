"""Many random programs: followed as they run, and landing where they say."""
