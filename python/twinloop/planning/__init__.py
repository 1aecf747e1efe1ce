"""From a committee to the gains to fly and to the next test."""
