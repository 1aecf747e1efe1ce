"""The report: one page in HTML that says first what to believe, then shows why."""
