"""Functional mock-up units: the C of a twin behind the interface of FMI, as a file that other simulators load."""
