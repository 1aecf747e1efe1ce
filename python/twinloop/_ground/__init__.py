"""What everything stands on: numbers that come in, the same bits everywhere, texts, versions."""
