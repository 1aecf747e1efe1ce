"""The exam, `twinloop bench power`: how little data a twin and a controller need, beside what others need."""
