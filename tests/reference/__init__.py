"""What the native core computes, written plainly: slow, and by the definition."""
