"""What an engineer checks before believing a twin or flying a controller: numbers alone, no pictures."""
