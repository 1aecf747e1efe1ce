"""The dashboard: a store in the browser, with what people say of tests on the way back."""
