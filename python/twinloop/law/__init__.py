"""Laws: expressions that share their equal parts, the equations of a twin made of them, and what is written of both."""
